"""The body (paper 4.1): a mesh, its parts, the primitives that stand for them in contact, and how it moves."""
