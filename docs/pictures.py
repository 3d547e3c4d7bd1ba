"""Render the pictures of README and gallery into docs/img: python docs/pictures.py [NAME …]"""

import sys
import tempfile
from pathlib import Path

import cv2
import numpy as np

from taichi_cloth.body.figure.build import built_in_body
from taichi_cloth.body.parts.segment import segment
from taichi_cloth.fibre.contours import known_contours
from taichi_cloth.ground import runtime
from taichi_cloth.render.image.caption import caption
from taichi_cloth.render.image.image import contact_sheet, read_png
from taichi_cloth.scenes.body.body_fit import draw_fit
from taichi_cloth.scenes.models.build import build
from taichi_cloth.scenes.models.cloth_model import ClothModel
from taichi_cloth.scenes.models.garment_model import GarmentModel, box_round
from taichi_cloth.scenes.paper.figures import FIGURES, fitted
from taichi_cloth.scenes.picture.view import View
from taichi_cloth.scenes.picture.zoom import zoom
from taichi_cloth.scenes.prepare.body_setup import primitives_of
from taichi_cloth.scenes.prepare.garment_setup import dropped
from taichi_cloth.scenes.scene.load import load_scene
from taichi_cloth.scenes.studies.appearance import measured, side_by_side
from taichi_cloth.scenes.studies.looks.cases import CASES
from taichi_cloth.scenes.studies.make import what_to_install

HERE = Path(__file__).parent
SCHORT = HERE.parent / "tests" / "data" / "wif" / "schort.wif"


def dyed(warp: str, weft: str | None = None) -> list[str]:
    """Overrides by which a cloth has these colours."""
    return [f"weave.warp_colours='{warp}'", f"weave.weft_colours='{weft or warp}'"]


CLOTHS = {
    "cotton poplin": ["cloth.material=poplin", "light.exposure=-0.25", *dyed("#f6f3ec")],
    "silk satin": [
        "fibre.kind=silk", "yarn.count='20/22 den x 3'", "yarn.twist_multiplier=0.3", "weave.draft=satin-8",
        "fabric.ends_per_cm=90", "fabric.picks_per_cm=44", "fabric.flattening=2.2", *dyed("#a30d24"),
        "camera.aim=[0.42,0.4]",
    ],
    "wool flannel": ["cloth.material=wool-flannel", *dyed("#0e0f11")],
    "denim": ["cloth.material=denim-12oz", *dyed("#2c3c62", "#cbc2ab")],
    "linen": [
        "yarn.count='NeL 40'", "yarn.twist_multiplier=3.2", "fibre.fineness_dtex=3", "light.finish=linen",
        "fabric.ends_per_cm=22", "fabric.picks_per_cm=20", *dyed("#c9b48c"),
    ],
}  # fmt: skip
"""A white, a saturated and a black one among them."""
LAID = [
    "cloth.width_m=0.3", "cloth.length_m=0.3", "cloth.height_m=0.078", "cloth.columns=49", "cloth.rows=49",
    "forces.sphere.radius_m=0.075", "forces.plane.height_m=-0.075", "camera.elevation_deg=32",
    "camera.box_m=[[-0.108,-0.075,-0.108],[0.108,0.078,0.108]]",
]  # fmt: skip
"""A napkin over a ball of 15 cm."""
CLOTH_FRAME = 59
DISTANCES = 25, (0, 6, 11, 17)
"""Frames of a zoom, and which of them are shown."""
LOSSLESS = 150_000
"""Bytes of a file up to which it is kept without loss."""
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


def materials() -> np.ndarray:
    """One weave and one dye in four fibres under one light."""
    dye = "#8c2f39"
    weave = [f"yarn.colour='{dye}'", f"weave.warp_colours='{dye}'", f"weave.weft_colours='{dye}'", "weave.ends=46"]
    weave += ["weave.picks=40", "yarn.plies=1", "yarn.count_tex=36", "yarn.twist_per_m=600"]
    weave += ["fabric.ends_per_cm=30", "fabric.picks_per_cm=24", "fabric.flattening=1.5"]
    weave += ["fabric.pose=wave", "fabric.pose_amount=1.6", "camera.zoom=1.35"]
    filament = ["ends_per_m=0", "loops_per_m=0"]
    hairs = {"silk": filament, "polyester": filament, "wool": ["ends_per_m=2500", "loops_per_m=1500", "height_mm=0.3"]}
    twist = {"silk": ["yarn.twist_per_m=300"], "polyester": ["yarn.twist_per_m=300"]}
    images = []
    for kind in ("cotton", "silk", "wool", "polyester"):
        own = [f"yarn.hairiness.{h}" for h in hairs.get(kind, [])] + twist.get(kind, [])
        image = picture("twill", f"fibre.kind={kind}", *weave, *own, size=(900, 800))[0]
        images.append(caption(image, kind))
    return np.concatenate([np.concatenate(images[:2], axis=1), np.concatenate(images[2:], axis=1)], axis=0)


def cloths() -> np.ndarray:
    """Five cloths of the trade over a ball of 15 cm, each from four distances."""
    rows = []
    for name, about in CLOTHS.items():
        model = build(load_scene("drape", [*LAID, *about]))
        model.step(CLOTH_FRAME)
        images = [image for _, image in zoom(View(model, (320, 240)), DISTANCES[0], list(DISTANCES[1]))]
        images[0] = caption(images[0], name)
        rows.append(np.concatenate(images, axis=1))
    return np.concatenate(rows, axis=0)


def fringe() -> np.ndarray:
    """Flyaway fibres of a wool edge against the light."""
    backlit = ["light.rim_strength=1.5", "light.rim_azimuth_deg=178", "light.rim_elevation_deg=32"]
    backlit += ["light.key_strength=0.25", "light.fill_strength=0.35", "light.follows_camera=true"]
    backlit += ["light.background=['#3a3f49', '#171a20']", "stage.ground=false"]
    woolly = ["fibre.kind=wool", "yarn.hairiness.ends_per_m=9000", "yarn.hairiness.loops_per_m=3000"]
    woolly += ["yarn.hairiness.height_mm=0.22", "fabric.steps=20", "fabric.fringe=3"]
    view = ["weave.ends=20", "weave.picks=12", "weave.warp_colours=camel", "weave.weft_colours=cream"]
    view += ["camera.elevation_deg=30", "camera.azimuth_deg=12", "camera.zoom=1.2"]
    return picture("plain", *backlit, *woolly, *view, size=(1800, 900))[0]


def moved(name: str, *overrides: str, size: tuple[int, int], frame: int) -> np.ndarray:
    """A frame of a cloth that moves."""
    model = build(load_scene(name, list(overrides)))
    model.step(frame)
    return next(image for _, image in View(model, size).turntable(1, [0]))


def drape(*overrides: str, size: tuple[int, int] = (1080, 960)) -> np.ndarray:
    """One sheet as a mesh and as fibres (paper, Figure 9)."""
    images, simulation = [], None
    for form in ("mesh", "fibre"):
        model = build(load_scene("drape", [f"cloth.representation={form}", "camera.zoom=1.15", *overrides]))
        assert isinstance(model, ClothModel)
        model.simulation = simulation or model.simulation
        model.step(model.frames - 1)
        simulation = model.simulation
        images += [image for _, image in View(model, size).turntable(1, [0])]
    return np.concatenate(images, axis=1)


def worn(name: str, *overrides: str, size: tuple[int, int], views: list[int]) -> np.ndarray:
    """A garment at rest, some of twelve views round it side by side."""
    view = View(build(load_scene(name, list(overrides))), size)
    return np.concatenate([image for _, image in view.turntable(12, views)], axis=1)


def panels() -> np.ndarray:
    """A WIF file on all panels of a T-shirt, and a weave of its own on each sleeve of another."""
    sleeves = ["weave.draft=herringbone", "weave.warp_colours=#e9e4d8", "weave.weft_colours=#7d8794"]
    for side in ("left", "right"):
        sleeves += [f"garment.weaves.{side}_sleeve=satin-5"]
        sleeves += [f"garment.colours.{side}_sleeve.{family}=#8f1f3f" for family in ("warp", "weft")]
    shirts = ([f"weave.draft={SCHORT}"], sleeves)
    return np.concatenate([worn("tshirt", *one, size=(1120, 1120), views=[0]) for one in shirts], axis=1)


def body() -> np.ndarray:
    """The built-in woman in parts, and in primitives (paper, Figures 10 and 11)."""
    made = built_in_body(gender="female")
    faces = made.faces.astype(np.int64)
    found = segment(made.vertices, faces)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "body.png"
        draw_fit(made.vertices, faces, found.labels, found.names, primitives_of(made), path)
        return read_png(path)


def appearance() -> np.ndarray:
    """Six cases of `taichi-cloth report --only appearance`, each beside the path tracer's picture."""
    shown = ["plain", "satin", "plain, upper half of the sky", "plain, lower half of the sky", "twill"]
    shown += ["basket, window behind"]
    pairs = []
    for case in (one for name in shown for one in CASES if one.name == name):
        ours, reference, _, _ = measured(case, quick=False)
        pairs += side_by_side(case, ours, reference, width=480)[:2]
    return contact_sheet(pairs, columns=4, thumbnail=480)


def violence() -> np.ndarray:
    """A silk flag in a gale, a T-shirt whose wearer has folded the arms, and one that was dropped on the floor."""
    gale = moved("flag", "forces.wind.velocity_m_per_s=[20,0,0.8]", "camera.zoom=1.15", size=(960, 960), frame=40)
    folded = moved("tshirt", "body.motion=arms-folded", "camera.azimuth_deg=20", size=(960, 960), frame=50)
    model = build(load_scene("tshirt", ["camera.elevation_deg=35", "camera.zoom=1.5", "stage.ground=true"]))
    assert isinstance(model, GarmentModel)
    model.simulation, model.solids = dropped(model.scene, model.dressed), lambda: ()  # pyright: ignore[reportAttributeAccessIssue]
    model.step(60)
    model.bounds = box_round(model.simulation.positions[model.simulation.sheet.present])
    heap = View(model, (960, 960))
    return np.concatenate([gale, folded, *(image for _, image in heap.turntable(1, [0]))], axis=1)


def zoomed() -> np.ndarray:
    """Twelve frames of `taichi-cloth zoom swatch`."""
    view = View(build(load_scene("swatch", [])), (960, 640))
    return contact_sheet([image for _, image in zoom(view, 12, list(range(12)))], columns=4, thumbnail=640)


PICTURES = {
    "tshirt": lambda: worn("tshirt", size=(840, 1120), views=[0, 2, 6]),
    "panels": panels,
    "skirt": lambda: worn("skirt", size=(840, 1120), views=[0, 2]),
    "dress": lambda: worn("dress", size=(840, 1120), views=[0, 2]),
    "trousers": lambda: worn("trousers", size=(840, 1120), views=[0, 2]),
    "outfit_summer": lambda: worn("outfit-summer", size=(800, 1000), views=[0]),
    "outfit_tartan": lambda: worn("outfit-tartan", size=(800, 1000), views=[0]),
    "body": body,
    "materials": materials,
    "cloths": cloths,
    "fringe": fringe,
    "zoom": zoomed,
    "drape": drape,
    "flag": lambda: moved("flag", size=FABRIC, frame=90),
    "violence": violence,
    "hanging": lambda: moved("hanging", size=(1080, 1350), frame=60),
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
if what_to_install("appearance") is None:
    PICTURES["appearance"] = appearance
PICTURES |= {Path(one.file).stem: lambda one=one: fitted(one.make(False)) for one in FIGURES}


AS_DRAWN = ("cloths",)
"""Not made half as large: what is near is smooth enough without."""


def webp(image: np.ndarray) -> bytes:
    """Without loss where that is small."""
    for quality in (101, 90):
        data = cv2.imencode(".webp", image[..., ::-1], [cv2.IMWRITE_WEBP_QUALITY, quality])[1].tobytes()
        if len(data) <= LOSSLESS:
            break
    return data


def main(names: list[str]) -> None:
    runtime.start()
    for name in names or PICTURES:
        image = PICTURES[name]()
        small = image if name in AS_DRAWN else cv2.resize(image, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
        path = HERE / "img" / f"{name}.webp"
        path.write_bytes(webp(small))
        print(f"{path.name}: {small.shape[1]} x {small.shape[0]}, {path.stat().st_size // 1024} kB")


if __name__ == "__main__":
    main(sys.argv[1:])
