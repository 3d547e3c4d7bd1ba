"""Cloth modelled from its fibres up: fibres, yarns, weaves, garments, their motion, and what every fibre looks like.

    >>> import taichi_cloth as tc
    >>> tc.named_weave("twill-2/2").warp_up.shape
    (4, 4)

This is the front door: the names below are all that most programs need, each fetched from its room when it is first
asked for. Importing starts nothing; `start` does. The rooms behind it follow Zhu, Li & Ma 2016, "Fiber-Based 3D Cloth
Modeling and Garment Simulation with Photorealistic Appearance"; `docs/house.md` draws them.
"""

import os
from importlib import import_module
from typing import TYPE_CHECKING, Any

# Taichi prints a banner when it is imported and asks a server for its newest version: neither is wanted
# in a log. Both switches are read at import, so they are set before any module of ours imports taichi.
os.environ.setdefault("ENABLE_TAICHI_HEADER_PRINT", "0")
os.environ.setdefault("TI_SKIP_VERSION_CHECK", "ON")

# Taichi ends the process where it finds no home: one from the list of users then, or a place where nothing is kept.
if os.name == "posix" and not (os.environ.get("HOME") or os.environ.get("XDG_CACHE_HOME")):
    os.environ.pop("HOME", None)
    _home = os.path.expanduser("~")
    os.environ["XDG_CACHE_HOME"] = f"{_home}/.cache" if os.path.isabs(_home) else os.devnull

__version__ = "0.1.0"

if TYPE_CHECKING:
    from taichi_cloth.fabric.woven import weave_fabric
    from taichi_cloth.ground.errors import InputError, Unstable
    from taichi_cloth.ground.runtime import start
    from taichi_cloth.mechanics.construction import Construction
    from taichi_cloth.mechanics.presets import named_construction
    from taichi_cloth.mechanics.properties import woven_properties
    from taichi_cloth.render.image.image import write_png
    from taichi_cloth.scenes.models.build import build
    from taichi_cloth.scenes.picture.view import View
    from taichi_cloth.scenes.plan.plan import plan
    from taichi_cloth.scenes.scene.load import built_in_scenes, load_scene
    from taichi_cloth.weave.draft import named_weave
    from taichi_cloth.weave.wif import read_wif
    from taichi_cloth.yarn.yarn import Yarn

__all__ = [
    "Construction",
    "InputError",
    "Unstable",
    "View",
    "Yarn",
    "__version__",
    "build",
    "built_in_scenes",
    "load_scene",
    "named_construction",
    "named_weave",
    "plan",
    "read_wif",
    "start",
    "weave_fabric",
    "woven_properties",
    "write_png",
]

_ROOMS = {
    "Construction": "mechanics.construction",
    "InputError": "ground.errors",
    "Unstable": "ground.errors",
    "View": "scenes.picture.view",
    "Yarn": "yarn.yarn",
    "build": "scenes.models.build",
    "built_in_scenes": "scenes.scene.load",
    "load_scene": "scenes.scene.load",
    "named_construction": "mechanics.presets",
    "named_weave": "weave.draft",
    "plan": "scenes.plan.plan",
    "read_wif": "weave.wif",
    "start": "ground.runtime",
    "weave_fabric": "fabric.woven",
    "woven_properties": "mechanics.properties",
    "write_png": "render.image.image",
}
"""Name to the module it lives in."""


def __getattr__(name: str) -> Any:
    room = _ROOMS.get(name)
    if room is None:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    found = getattr(import_module(f"{__name__}.{room}"), name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted(__all__)
