"""What a scene is, the built-in scenes, and the command line that runs them."""
