"""The paper's cloths have a thread at each key point, or few. Where a built-in scene is a real fabric, the paper's
tables and figures have one of their own here."""

from pathlib import Path

__all__ = ["PAPER_DRAPE", "scene_file"]


def scene_file(name: str) -> str:
    """What `load_scene` takes: the path of the scene of that name in this folder, or the name of the built-in one."""
    path = Path(__file__).parent / f"{name}.toml"
    return str(path) if path.exists() else name


PAPER_DRAPE = scene_file("drape")
"""A checked cloth on a ball, four threads a key point: Figure 9."""
