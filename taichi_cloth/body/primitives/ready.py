"""Primitives of the built-in bodies, fitted once by `fit` and kept in the package: fitting takes some seconds.

`python -m taichi_cloth.body.primitives.ready` makes the files again.
"""

import json
from importlib.resources import files
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.body.parts.parts import JOINTS
from taichi_cloth.body.primitives.primitive_file import load_primitives, primitives_json
from taichi_cloth.body.primitives.primitives import Primitive
from taichi_cloth.body.skin.skinning import Body

__all__ = ["SEEDS", "fit_body", "ready_primitives"]

SEEDS = {"female": 3, "male": 6}
"""Of nine fits each, alike in error, one on which garments walk with less than 10 % of stretch (docs/body.md)."""
MARKS = 97
NEAR = 1e-4  # [m]


def ready_primitives(body: Body) -> tuple[Primitive, ...] | None:
    """The primitives of a body whose skin is that of a built-in one to a tenth of a millimetre; None for others."""
    for entry in files("taichi_cloth.body.primitives").iterdir():
        if entry.name.endswith(".json"):
            skin = json.loads(entry.read_text("utf-8"))["skin"]
            own = _marks(body.vertices)
            if skin["vertices"] == len(body.vertices) and np.abs(np.asarray(skin["marks"]) - own).max() < NEAR:
                return tuple(load_primitives(str(entry)))
    return None


def fit_body(body: Body, *, seed: int = 0) -> list[Primitive]:
    """Primitives of any body, each carried by the bone of its part. seed: of the points the fit is made from."""
    from taichi_cloth.body.parts.segment import segment
    from taichi_cloth.body.primitives.fit import fit

    parts = segment(body.vertices, body.faces)
    bones = {name: body.skeleton.index(JOINTS[name]) for name in parts.names}
    return fit(body.vertices, body.faces, parts.labels, parts.names, bones=bones, seed=seed)


def _marks(vertices: NDArray) -> NDArray:
    """Some of the skin's points (MARKS, 3) by which it is known again [m]."""
    return vertices[np.linspace(0, len(vertices) - 1, MARKS).astype(int)]


def main() -> None:
    from taichi_cloth.body.figure.build import built_in_body

    for gender in ("female", "male"):
        body = built_in_body(gender=gender)
        skin = {"vertices": len(body.vertices), "marks": np.round(_marks(body.vertices), 6).tolist()}
        rounded = primitives_json(fit_body(body, seed=SEEDS[gender]), {"skin": skin})
        Path(__file__).with_name(f"{gender}.json").write_bytes(rounded)


if __name__ == "__main__":
    main()
