"""Light from fibre to fibre: our picture of cloth beside a path tracer's of the same fibres."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from taichi_cloth.ground import runtime

from ...render.image.caption import tag
from ...render.image.image import contact_sheet
from ..measure.likeness import DEPTHS, Likeness, flip, likeness, shown_alike
from ..measure.page import Section, csv_text
from ..measure.study import cpu_seconds
from .looks.cases import CASES, QUICK, YARN, Case, subject_of
from .looks.path_traced import path_traced

__all__ = [
    "LIMITS",
    "AppearanceRow",
    "Limits",
    "measured",
    "outside",
    "row_of",
    "section",
    "sections",
    "side_by_side",
]

F64 = NDArray[np.float64]
SIZE, SAMPLES = 200, 16
QUICK_SIZE, QUICK_SAMPLES = 96, 8
SHOWN = 260
"""Width of one picture on the page [px]."""
RUNS = 3


@dataclass(frozen=True)
class Limits:
    """How far each number may be off: luminance and depths of 1, blurred error, FLIP, saturation of the reference's."""

    luminance: float = 0.05
    blurred: float = 0.10
    depths: float = 0.15
    flip: float = 0.30
    saturation: float = 0.03

    def wider(self, by: float) -> "Limits":
        return Limits(*(by * value for value in vars(self).values()))


LIMITS = Limits()
UNSEEN = LIMITS.wider(1.5)
"""Where nothing was fitted: half as far again."""


@dataclass(frozen=True, kw_only=True)
class AppearanceRow:
    """A case's `Likeness` in columns, texts where there are several numbers, and CPU times."""

    case: str
    fitted: bool
    luminance: float
    red: float
    green: float
    blue: float
    blurred: float
    flip: float
    saturation: float
    saturation_reference: float
    depths_red: str
    depths_green: str
    depths_blue: str
    seconds: float
    seconds_reference: float


def sections(quick: bool, say: Callable[[str], object]) -> list[Section]:
    """The table of cases with their pictures."""
    rows: list[AppearanceRow] = []
    said: list[str] = []
    pictures: list[NDArray[np.uint8]] = []
    for case in (QUICK,) if quick else CASES:
        say(f"appearance: {case.name}")
        ours, reference, found, seconds = measured(case, quick)
        rows.append(row_of(case, found, seconds))
        limits = LIMITS if case.fitted else UNSEEN
        said.append(f"{case.name}: " + (", ".join(outside(found, limits)) or "all within") + ".")
        pictures += side_by_side(case, ours, reference)
    return [section(rows, said, pictures, quick)]


def measured(case: Case, quick: bool) -> tuple[F64, F64, Likeness, tuple[float, float]]:
    """Our picture, the reference's, how far they are apart, and the CPU time of each [s]."""
    size, samples = (QUICK_SIZE, QUICK_SAMPLES) if quick else (SIZE, SAMPLES)
    subject = subject_of(case, size)
    splatter, draw = subject.drawing()
    cost = cpu_seconds(draw, 1 if quick else RUNS)
    ours = subject.taken(splatter)
    reference, taken = path_traced(subject, samples * case.finer, runtime.threads())
    return ours, reference, likeness(ours, reference, subject.sky_seen()), (cost, taken)


def row_of(case: Case, found: Likeness, seconds: tuple[float, float]) -> AppearanceRow:
    red, green, blue = (" ".join(f"{v:.2f}" for v in found.depths[:, c]) for c in range(3))
    return AppearanceRow(
        case=case.name,
        fitted=case.fitted,
        luminance=found.luminance,
        red=found.colours[0],
        green=found.colours[1],
        blue=found.colours[2],
        blurred=found.blurred,
        flip=found.flip,
        saturation=found.saturation[0],
        saturation_reference=found.saturation[1],
        depths_red=red,
        depths_green=green,
        depths_blue=blue,
        seconds=seconds[0],
        seconds_reference=seconds[1],
    )


def outside(found: Likeness, limits: Limits) -> list[str]:
    """What of a case is farther off than it may be, in words."""
    out = []
    if abs(found.luminance - 1) > limits.luminance:
        out.append(f"luminance {found.luminance:.2f}")
    if found.blurred > limits.blurred:
        out.append(f"blurred error {found.blurred:.2f}")
    far = [
        f"{name} {found.depths[np.abs(found.depths[:, c] - 1).argmax(), c]:.2f}"
        for c, name in enumerate(("red", "green", "blue"))
        if np.abs(found.depths[:, c] - 1).max() > limits.depths
    ]
    if far:
        out.append(f"depths to {', '.join(far)}")
    if found.flip > limits.flip:
        out.append(f"FLIP {found.flip:.2f}")
    apart = found.saturation[0] - found.saturation[1]
    if abs(apart) > limits.saturation:
        out.append(f"saturation {apart:+.3f}")
    return out


def side_by_side(case: Case, ours: F64, reference: F64, width: int = SHOWN) -> list[NDArray[np.uint8]]:
    """Ours, the reference, and FLIP from black (the same) to white, each with its words, `width` pixels wide."""
    one, two = shown_alike(ours, reference)
    error = np.repeat(flip(ours, reference)[..., None], 3, axis=2)
    words = case.name, "path traced", "FLIP"
    return [_labelled(image, text, width) for image, text in zip((one, two, error), words, strict=True)]


def _labelled(image: F64, text: str, width: int) -> NDArray[np.uint8]:
    by = cv2.INTER_CUBIC if image.shape[0] < width else cv2.INTER_AREA
    large = cv2.resize((255 * image).round().astype(np.uint8), (width, width), interpolation=by)
    return tag(np.asarray(large, np.uint8), text.replace("°", " deg").replace("×", "x"))


def section(
    rows: Sequence[AppearanceRow], said: Sequence[str], pictures: Sequence[NDArray[np.uint8]], quick: bool
) -> Section:
    sheet = contact_sheet(pictures, columns=3, thumbnail=SHOWN)
    done, png = cv2.imencode(".png", sheet[..., ::-1])
    assert done
    table = [
        (
            row.case,
            "" if row.fitted else "not fitted",
            f"{row.luminance:.2f}",
            f"{row.red:.2f} / {row.green:.2f} / {row.blue:.2f}",
            f"{row.blurred:.2f}",
            f"{row.flip:.2f}",
            f"{row.saturation:.3f} ({row.saturation_reference:.3f})",
            row.depths_red,
            row.depths_green,
            row.depths_blue,
            f"{row.seconds:.2f} s",
            f"{row.seconds_reference:.0f} s",
        )
        for row in rows
    ]
    size, samples = (QUICK_SIZE, QUICK_SAMPLES) if quick else (SIZE, SAMPLES)
    return Section(
        name="appearance",
        title="Appearance: beside a path tracer",
        about="Threads of all their fibres, and the same fibres as curves in Mitsuba with its hair BSDF, the "
        f"absorption at which a thick mass of them has the colour, {size} × {size} pixels of {samples} samples, of a "
        f"yarn {YARN.finer} times as many. Red, green and blue are three albedos at once. All numbers are of the "
        "pixels that both cover, ours over the "
        "reference's; blurred: root mean square of luminance after a blur of 5 pixels; depths: "
        f"{len(DEPTHS) - 1} bins of pixels by how much of the sky their fibres see, from the interstices to the "
        "crowns, at each albedo; FLIP: its mean, at one exposure for both. The lines below say what is outside of "
        f"luminance {1 - LIMITS.luminance:.2f} to {1 + LIMITS.luminance:.2f}, blurred error {LIMITS.blurred:.2f}, "
        f"depths {1 - LIMITS.depths:.2f} to {1 + LIMITS.depths:.2f}, FLIP {LIMITS.flip:.2f}, saturation "
        f"± {LIMITS.saturation:.2f}; half as far again where nothing was fitted.",
        sentences=said,
        head=(
            "case",
            "",
            "luminance",
            "by colour",
            "blurred",
            "FLIP",
            "saturation (reference's)",
            "depths, red",
            "depths, green",
            "depths, blue",
            "our CPU time",
            "the path tracer's",
        ),
        table=table,
        csv=csv_text(rows),
        image=png.tobytes(),
    )
