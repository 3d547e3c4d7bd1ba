"""Scenes of the paper's figures whose threads follow key points, apart from the built-in ones of real cloths."""

from importlib.resources import files

__all__ = ["PAPER_DRAPE"]

PAPER_DRAPE = str(files("taichi_cloth.scenes.paper") / "drape.toml")
"""A checked cloth on a ball, four threads a key point: Figure 9."""
