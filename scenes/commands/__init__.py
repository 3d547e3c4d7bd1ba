"""The commands that make pictures: turntable, animate, zoom, still."""
