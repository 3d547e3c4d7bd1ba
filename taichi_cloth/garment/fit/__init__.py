"""Patterns of others on any body: what is on which part, what carries it, placed, graded, widened and held."""
