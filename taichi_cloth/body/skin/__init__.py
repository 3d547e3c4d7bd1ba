"""A body as a skin over a skeleton: both, what binds them, and what is measured on a skin."""
