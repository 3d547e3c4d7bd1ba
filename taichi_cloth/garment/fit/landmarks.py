"""What placing and grading need to know of a body: heights of its landmarks, girths, and where its limbs are.

A pattern was drafted for a body too. Files do not say which, but their heights tell whose floor they are measured from,
and that body is one of two.
"""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

__all__ = ["HEIGHTS", "SMPL_ORIGIN", "Landmarks", "drafting_body"]

F64 = NDArray[np.float64]

HEIGHTS = ("floor", "knee", "crotch", "waist", "underarm", "shoulder", "neck", "top")
"""Between which heights are mapped linearly. Hip and bust lie too near to others to be among them."""

SMPL_ORIGIN = 1.121
"""Of SMPL's female template, over its soles [m]: y = 0 in files of the Garment-Pattern-Generator."""


@dataclass(frozen=True, eq=False)
class Landmarks:
    """Of a standing body that faces +z; lengths in metres.

    height: from the floor, of HEIGHTS and of hip, underbust, bust. girth: of hip, waist, underbust, bust, neck, head,
    upper_arm, wrist, thigh, knee, ankle. depth: z of the front and of the back at hip, waist, underbust, bust, neck,
    top. shoulder: between the shoulders' joints. arm: (3, 3) of shoulder, elbow, wrist; leg: (3, 3) of hip joint, knee,
    ankle; both left. rings: (n, 5) height, girth, half the breadth, half the depth and middle z of both legs and of the
    trunk, upwards.
    """

    height: dict[str, float]
    girth: dict[str, float]
    depth: dict[str, tuple[float, float]]
    shoulder: float
    arm: F64
    leg: F64
    rings: F64 = field(default_factory=lambda: np.zeros((0, 5)))

    def scaled(self, by: float) -> "Landmarks":
        """A body of the same shape, `by` times as tall."""
        return replace(
            self,
            height={k: by * v for k, v in self.height.items()},
            girth={k: by * v for k, v in self.girth.items()},
            depth={k: (by * a, by * b) for k, (a, b) in self.depth.items()},
            shoulder=by * self.shoulder,
            arm=by * self.arm,
            leg=by * self.leg,
            rings=by * self.rings,
        )

    def ring(self, y: float) -> tuple[float, float, float, float]:
        """Girth, half the breadth, half the depth and middle z of trunk or both legs at a height [m]."""
        return tuple(float(np.interp(y, self.rings[:, 0], self.rings[:, k])) for k in range(1, 5))  # type: ignore[return-value]


def drafting_body(floor: bool) -> Landmarks:
    """Whom a file was drafted for: floor: GarmentCode's average adult (mean_all), its arms 45.5° down; else SMPL's
    average woman with level arms, of the Garment-Pattern-Generator. Both measured on the meshes that these projects
    ship, as `taped` measures any body."""
    return _GARMENTCODE if floor else _GENERATOR


_GENERATOR = Landmarks(
    height={"floor": 0.0, "knee": 0.426, "crotch": 0.772, "hip": 0.822, "waist": 1.075, "underbust": 1.157,
            "bust": 1.224, "underarm": 1.232, "shoulder": 1.39, "neck": 1.411, "top": 1.658},
    girth={"hip": 1.043, "waist": 0.811, "underbust": 0.878, "bust": 0.983, "neck": 0.347, "head": 0.577,
           "upper_arm": 0.275, "wrist": 0.164, "thigh": 0.623, "knee": 0.353, "ankle": 0.23},
    depth={"hip": (0.099, -0.147), "waist": (0.12, -0.11), "underbust": (0.099, -0.132), "bust": (0.11, -0.144),
           "neck": (0.033, -0.083), "top": (0.098, -0.113)},
    shoulder=0.333,
    arm=np.array([[0.167, 1.31, -0.024], [0.44, 1.333, -0.063], [0.672, 1.331, -0.059]]),
    leg=np.array([[0.093, 0.786, -0.03], [0.09, 0.426, -0.039], [0.098, 0.07, -0.042]]),
)  # fmt: skip
_GARMENTCODE = Landmarks(
    height={"floor": 0.0, "knee": 0.476, "crotch": 0.776, "hip": 0.846, "waist": 1.115, "underbust": 1.197,
            "bust": 1.263, "underarm": 1.27, "shoulder": 1.422, "neck": 1.466, "top": 1.72},
    girth={"hip": 1.038, "waist": 0.841, "underbust": 0.913, "bust": 1.008, "neck": 0.392, "head": 0.586,
           "upper_arm": 0.277, "wrist": 0.161, "thigh": 0.583, "knee": 0.374, "ankle": 0.235},
    depth={"hip": (0.108, -0.146), "waist": (0.133, -0.1), "underbust": (0.118, -0.117), "bust": (0.123, -0.13),
           "neck": (0.08, -0.057), "top": (0.139, -0.076)},
    shoulder=0.345,
    arm=np.array([[0.173, 1.359, -0.011], [0.374, 1.16, -0.009], [0.549, 1.01, 0.038]]),
    leg=np.array([[0.096, 0.865, -0.026], [0.099, 0.476, -0.026], [0.104, 0.072, -0.021]]),
)  # fmt: skip
