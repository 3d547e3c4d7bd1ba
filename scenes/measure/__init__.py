"""Timing, and what studies share: rows, diagrams, the page."""
