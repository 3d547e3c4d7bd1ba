"""Primitives (paper 4.1): spheres, cylinders and elliptic cylinders that stand for the parts of a body."""
