"""How a woven cloth weighs, bends, shears and pulls, from its fibre, its yarns, its weave and its sett."""
