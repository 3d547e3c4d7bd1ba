"""Cloth that meets cloth: layers of a sheet that never pass through each other, proven interval by interval."""
