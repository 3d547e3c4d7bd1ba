"""A frame as parallel loops, one after the other: for graphics devices, and for sheets too large for a crew."""
