"""Render the pictures of the README into docs/img: python docs/pictures.py [NAME …]"""

import sys
from pathlib import Path

import cv2
import numpy as np

from taichi_cloth import runtime
from taichi_cloth.contours import known_contours
from taichi_cloth.scenes.load import load_scene
from taichi_cloth.scenes.models import build
from taichi_cloth.scenes.view import View

HERE = Path(__file__).parent
SCHORT = HERE.parent / "tests" / "data" / "wif" / "schort.wif"
FABRIC = (1440, 960)  # drawn at twice the size, so that threads finer than a pixel come out smooth


def picture(name: str, *overrides: str, size: tuple[int, int], frames: list[int] | None = None) -> list[np.ndarray]:
    """Images of a scene: the first view of its turntable, or frames of its animation."""
    model = build(load_scene(name, list(overrides)))
    view = View(model, size)
    drawn = view.turntable(1, [0]) if frames is None else view.animation(frames)
    return [image for _, image in drawn]


def fibre() -> np.ndarray:
    kinds = [
        picture("fibre", f"fibre.kind={k}", "fibre.length_um=90", "fibre.spacing_um=0.45", size=(560, 640))
        for k in known_contours()
    ]
    return np.concatenate([images[0] for images in kinds], axis=1)


def twist() -> np.ndarray:
    return np.concatenate(picture("twist", size=(1920, 480), frames=[0, 12, 30, 71]), axis=0)


PICTURES = {
    "swatch": lambda: picture("swatch", size=FABRIC)[0],
    "fibre": fibre,
    "yarn": lambda: picture("yarn", size=(800, 1200))[0],
    "twist": twist,
    "plain": lambda: picture("plain", size=FABRIC)[0],
    "twill": lambda: picture("twill", size=FABRIC)[0],
    "satin": lambda: picture("satin", size=FABRIC)[0],
    "tartan": lambda: picture("tartan", size=FABRIC)[0],
    "houndstooth": lambda: picture("houndstooth", size=FABRIC)[0],
    "herringbone": lambda: picture("herringbone", size=FABRIC)[0],
    "schort": lambda: picture(
        "swatch", f"weave.draft={SCHORT}", "weave.ends=104", "weave.picks=76", "fabric.pose_amount=0.4", size=FABRIC
    )[0],
    "closeup": lambda: picture("closeup", size=(2160, 1440))[0],
}


def main(names: list[str]) -> None:
    runtime.start()
    for name in names or PICTURES:
        image = PICTURES[name]()
        small = cv2.resize(image, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
        path = HERE / "img" / f"{name}.webp"
        cv2.imwrite(str(path), small[..., ::-1], [cv2.IMWRITE_WEBP_QUALITY, 88])
        print(f"{path.name}: {small.shape[1]} x {small.shape[0]}, {path.stat().st_size // 1024} kB")


if __name__ == "__main__":
    main(sys.argv[1:])
