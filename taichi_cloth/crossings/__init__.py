"""Triangles that pass through others: an exact test of any mesh, and which pairs are worth it."""
