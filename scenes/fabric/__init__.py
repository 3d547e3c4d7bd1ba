"""The mill's ticket of a cloth: what it is made of, how it is woven, what it weighs and how it moves."""
