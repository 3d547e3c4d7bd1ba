"""What cloth can touch of a body (paper 4.1): primitives or distance grids, in a tree of boxes."""
