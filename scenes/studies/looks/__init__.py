"""Cloth and yarn of all their fibres in some light, a path tracer's picture of them, and how far ours is from it."""
