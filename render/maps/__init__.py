"""Maps of light: how they are laid over what is lit, and how they are read."""
