"""Constraints (paper 3.2 and 4.1): contact with bodies and of cloth with cloth, the strain limit, ties."""
