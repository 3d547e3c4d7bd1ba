"""Light: how a fibre answers it, shadows, and the sky that is seen between fibres."""
