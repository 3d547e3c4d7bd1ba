"""How a body moves: built-in motions, legs that keep their feet, BVH files."""
