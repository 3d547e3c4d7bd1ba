"""Fibres (paper 2.1): sets of spheres, their contours by kind, particles that fill them, the relief of their skin."""
