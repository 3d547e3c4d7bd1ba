"""Tiles: splats sorted and blended, triangles seen, pixel by pixel."""
