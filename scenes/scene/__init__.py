"""What a scene is: every section and key, and how files and overrides become one."""
