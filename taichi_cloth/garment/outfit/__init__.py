"""Outfits: several garments on one body, each its own cloth, which touch by the contact of cloth with cloth."""
