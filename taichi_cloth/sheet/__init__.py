"""The sheet (paper 3.1): key points on a grid, what its cloth is made of, and the springs between them."""
