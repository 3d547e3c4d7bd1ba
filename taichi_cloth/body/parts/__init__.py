"""Segmentation (paper 4.1): the named parts of a body."""
