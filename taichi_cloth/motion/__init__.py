"""Motion (paper 3.2): what acts on a sheet, the loop over frames, and what solvers and constraints share."""
