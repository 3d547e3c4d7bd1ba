"""What a scene will build, counted before anything runs."""
