"""The built-in bodies: from measures of a person to a closed skin."""
