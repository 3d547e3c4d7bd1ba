"""Cloth that meets cloth as parallel loops, for graphics devices: what `layers` does, key points or pairs at once."""
