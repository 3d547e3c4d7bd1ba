"""Yarns (paper 2.2): what a spinner states, where the fibres run, and how twist runs along a yarn being made."""
