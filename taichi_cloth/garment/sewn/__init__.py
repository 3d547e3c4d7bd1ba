"""Garments (paper 4): sewing, the limbs they lie on, weaving their threads, their surface and stitches."""
