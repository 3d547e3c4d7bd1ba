"""One picture of a scene, large and clean, and beside it what people who make data want: `taichi-cloth still`.

Colour is drawn on a canvas `supersample` times as large each way and averaged in linear light (with 1 as `turntable`
draws it). The passes are taken at the picture's own pixels, at their middles: depths and numbers must not be averaged.
`still.json` holds the cameras and says what the values in each file mean. The first view of a turntable frames the
picture.
"""

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.ground import runtime
from taichi_cloth.ground.errors import InputError, did_you_mean
from taichi_cloth.ground.files import write_bytes

from ...render.data.camera import Camera
from ...render.image.exr import require_exr, write_exr
from ...render.image.image import linear_to_srgb, write_png
from ...render.image.tone import Tone, tone_curve
from ...render.splat.passes import PASSES, Passes, render_passes
from ...render.splat.stream import stream_passes
from ..models.build import build, shown_frame
from ..models.model import Model, Numbers
from ..picture.samples import SAMPLES, averaged
from ..picture.view import Shot, View
from ..plan.plan import plan
from ..prepare.drawing import require_picture
from ..scene.load import load_scene
from ..scene.schema import Scene
from .device import device_of
from .output_folder import OutputFolder
from .run import image_size, require_fit

__all__ = ["FORMATS", "still"]

FORMATS = ("png", "png16", "exr")
MOST = 65535


def still(
    name: str,
    overrides: list[str],
    *,
    size: str | None,
    passes: str,
    form: str,
    supersample: int,
    out: Path | None,
    arch: Any,
    threads: int | None,
) -> None:
    """Scene to files; every file is whole or not there, `still.json` comes last. Raises InputError first of all."""
    wanted = passes_of(passes)
    scene = load_scene(name, overrides)
    width_height = scene.output.size if size is None else image_size(size)
    if supersample not in (1, 2, 4):
        raise InputError(f"--supersample: {supersample}; allowed: 1, 2, 4")
    if max(width_height) * supersample > 16384:
        raise InputError(f"--size {size} at --supersample {supersample}: over 16384 pixels; take a smaller one")
    if form not in FORMATS:
        raise InputError(f"--format: {form!r}; allowed: {', '.join(FORMATS)}{did_you_mean(form, FORMATS)}")
    if form == "exr":
        require_exr()
    folder = out or Path("out") / Path(name).stem
    require_picture(width_height, supersample)
    planned = plan(scene)
    ending = "exr" if form == "exr" else "png"
    with OutputFolder(folder) as held:
        held.refuse_foreign([*(f"{one}.{ending}" for one in wanted), "still.json"])
        runtime.start(device_of(planned, arch), threads=threads)
        model = build(scene, planned.prepared)
        model.step(shown_frame(scene, model))
        files = shoot(model, scene, width_height, wanted, form, supersample)  # all is made before any is written
        held.make()
        held.clean(files)
        held.claim(files)
        for file, (_, write) in files.items():
            write(folder / file)
    print(f"{', '.join(files)} in {folder}")
    require_fit(model)


def passes_of(text: str) -> tuple[str, ...]:
    """The passes of a `--passes colour,depth,…`. Raises InputError."""
    known = ("colour", *PASSES)
    names = tuple(dict.fromkeys(n.strip().lower().replace("color", "colour") for n in text.split(",") if n.strip()))
    for name in names:
        if name not in known:
            raise InputError(f"--passes: unknown pass {name!r}; known: {', '.join(known)}{did_you_mean(name, known)}")
    if not names:
        raise InputError(f"--passes: none given; known: {', '.join(known)}")
    return names


@dataclass(frozen=True)
class Layers:
    """One panel's pictures and camera."""

    colour: NDArray[np.float32] | None
    passes: Passes
    camera: dict[str, Any]
    numbers: Numbers | None


def shoot(
    model: Model, scene: Scene, size: tuple[int, int], wanted: tuple[str, ...], form: str, supersample: int
) -> dict[str, tuple[dict[str, Any], Callable[[Path], None]]]:
    """File name to (what its values mean, how to write it); `still.json` is the last."""
    colours: list[NDArray[np.float32]] = []
    masks: list[NDArray[np.float32]] = []
    cameras: list[Camera] = []
    view = View(model, size, scale=supersample)
    if "colour" in wanted:
        for shot in view.shots():
            colours.append(averaged(view.light_of(shot), shot.scale))
            cameras.append(shot.camera.on_canvas(1 / shot.scale))
    if "mask" in wanted:  # of as many samples as the colour, or it would cover more than that shows
        for shot in view.bare_shots(SAMPLES):
            mask = _passes(shot, None, ("mask",)).mask
            assert mask is not None
            masks.append(averaged(mask[..., None], shot.scale).reshape(shot.camera.height // shot.scale, -1))
            cameras.append(shot.camera.on_canvas(1 / shot.scale))
    data = tuple(name for name in wanted if name not in ("colour", "mask"))
    made = list(View(model, size).bare_shots()) if data else []
    layers, left = [], 0
    for k in range(max(len(made), len(colours), len(masks))):
        passes, numbers, camera = Passes(), None, made[k].camera if data else cameras[k]
        if data:
            number = made[k].panel.numbers if "id" in data else None
            numbers = None if number is None else number()
            passes = _passes(made[k], numbers, data)
        described = camera.matrices() | {"left": left}
        passes = replace(passes, mask=masks[k] if masks else None)
        layers.append(Layers(colours[k] if colours else None, passes, described, numbers))
        left += camera.width
    files = _files(layers, size[0], form, scene.light.tone)
    about = {
        "scene": scene.title,
        "size": list(size),
        "cameras": [one.camera for one in layers],
        "files": {file: meaning for file, (meaning, _) in files.items()},
    }
    tables = [one.numbers for one in layers if one.numbers]
    if tables:
        about["yarns"] = {str(k + 1): v for k, v in tables[0].yarns.items()}
        about["parts"] = {str(k + 1): v for k, v in tables[0].parts.items()}
    text = json.dumps(about, indent=1).encode() + b"\n"
    files["still.json"] = ({}, lambda path: write_bytes(path, text))
    return files


def _passes(shot: Shot, numbers: Numbers | None, data: tuple[str, ...]) -> Passes:
    """What is asked for of a panel whose particles have these numbers."""
    particles, splatter, camera = shot.panel.particles, shot.splatter, shot.camera
    if shot.panel.source is not None:
        return stream_passes(splatter, camera, shot.panel.source, data, backdrop=shot.backdrop, mesh=shot.mesh)[1]
    if numbers is not None:
        particles = replace(particles, yarn=numbers.yarn, part=numbers.part)
    return render_passes(splatter, camera, particles, data, backdrop=shot.backdrop, mesh=shot.mesh)


def _shown(colour: NDArray[np.float32], tone: Tone, top: int) -> NDArray[Any]:
    """sRGB, rounded by a fixed fine pattern so that smooth backgrounds show no bands (J. Jimenez, "Next generation
    post processing in Call of Duty", 2014: interleaved gradient noise)."""
    y, x = np.indices(colour.shape[:2], np.float32)
    pattern = (52.9829189 * ((0.06711056 * x + 0.00583715 * y) % 1.0)) % 1.0
    value = linear_to_srgb(tone_curve(tone, colour)) * top + np.expand_dims(pattern, -1)
    return np.minimum(value, top).astype(np.uint8 if top == 255 else np.uint16)


def _files(
    layers: list[Layers], width: int, form: str, tone: Tone
) -> dict[str, tuple[dict[str, Any], Callable[[Path], None]]]:
    """The files of the passes that were made."""

    def joined(images: list[Any]) -> NDArray[Any] | None:
        return None if images[0] is None else np.concatenate(images, axis=1)[:, :width]

    files: dict[str, tuple[dict[str, Any], Callable[[Path], None]]] = {}

    def put(name: str, meaning: dict[str, Any], image: NDArray[Any], channels: str) -> None:
        if form == "exr":
            planes = {c: image[..., k] if image.ndim == 3 else image for k, c in enumerate(channels.split())}
            files[f"{name}.exr"] = (meaning, lambda path: write_exr(path, planes))
        else:
            files[f"{name}.png"] = (meaning, lambda path: write_png(path, image))

    exr = form == "exr"
    colour = joined([one.colour for one in layers])
    if colour is not None:
        top = 255 if form == "png" else MOST
        meaning = {"is": "linear light, before the tone curve" if exr else f"sRGB, 0 to {top}", "tone": tone}
        put("colour", meaning, colour if exr else _shown(colour, tone, top), "R G B")
    depth = joined([one.passes.depth for one in layers])
    if depth is not None:
        on = depth > 0
        near, far = (float(depth[on].min()), float(depth[on].max())) if on.any() else (0.0, 1.0)
        step = max(far - near, 1e-9) / (MOST - 1)
        meaning: dict[str, Any] = {
            "is": "distance along the viewing direction where half of the light still passes; 0 is nothing",
            "near_m": near,
            "far_m": far,
        }
        if not exr:
            meaning |= {"depth_m": "offset_m + scale_m * value", "scale_m": step, "offset_m": near - step}
            depth = np.where(on, (depth - near) / step + 1.5, 0).clip(0, MOST).astype(np.uint16)
        put("depth", meaning, depth, "Z")
    normal = joined([one.passes.normal for one in layers])
    if normal is not None:
        meaning = {"is": "unit normal, world axes, y up; 0 0 0 is nothing" if exr else "as below; 0 0 0 is nothing"}
        if not exr:
            meaning["normal"] = "(value - 32768) / 32767, world axes, y up"
            nothing = (normal == 0).all(axis=-1, keepdims=True)
            normal = np.where(nothing, 0, np.round(normal * 32767) + 32768).astype(np.uint16)
        put("normal", meaning, normal, "X Y Z")
    mask = joined([one.passes.mask for one in layers])
    if mask is not None:
        meaning = {"is": "share of the pixel that is covered" + ("" if exr else f", 0 to {MOST}")}
        put("mask", meaning, mask if exr else (mask * MOST + 0.5).astype(np.uint16), "A")
    for name in ("yarn", "part"):
        number = joined([getattr(one.passes, name) for one in layers])
        if number is not None:
            if not exr and number.max() >= MOST:
                raise InputError(f"{name} numbers: up to {number.max()}; a PNG holds {MOST - 1}; take --format exr")
            meaning = {"is": f"number of the {name} that is seen (see {name}s), from 1; 0 is none"}
            put(name, meaning, (number + 1).astype(np.uint32 if exr else np.uint16), "id")
    return files
