"""What the study of solvers is made of: cases, the reference and schemes beside it, settings, the crossing."""
