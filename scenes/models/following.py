"""A camera that goes with a body that walks away: where its pelvis goes is known before, so it neither lags nor shakes.

A body that stays where it is, as it walks on the spot, sways or sits down, is seen from where the camera stands.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from taichi_cloth.body.moving.motion import Motion

__all__ = ["AWAY", "camera_path"]

F64 = NDArray[np.float64]

AWAY = 0.6
"""How far from its start the pelvis goes in a motion that is followed [m]: those who sit down stay below it."""
SMOOTH = 0.3
"""Standard deviation of the weights over time that smooth its path [s]: of a stride's sway a quarter is left, a
few millimetres. Longer, and the camera is before the body as that sets off."""
REACH = 3.0
"""Of them, to each side."""


def camera_path(motion: Motion, frames: int, fps: float, wanted: bool | None = None) -> F64:
    """How far the camera has gone in each frame (frames, 3) [m], from rest at the first; zeros where it stands. wanted:
    None where the motion is to tell. Heights are followed apart: only of who climbs.

    The way before the first frame is the way after it turned round its start, so that the camera begins where the body
    does; after the last one the motion goes on.
    """
    if wanted is False or motion.name == "rest" or frames < 1:
        return np.zeros((max(frames, 1), 3))
    more = int(np.ceil(REACH * SMOOTH * fps))
    way = np.array([motion.pose(k / fps).translation for k in range(frames + more)])
    way = way - way[0]
    before = -way[more:0:-1]
    smooth = gaussian_filter1d(np.vstack([before, way]), SMOOTH * fps, axis=0, truncate=REACH)[more : more + frames]
    level, up = way[:frames] * [1, 0, 1], way[:frames] * [0, 1, 0]
    for part, axes in ((level, [0, 2]), (up, [1])):
        if not wanted and np.linalg.norm(part, axis=1).max() <= AWAY:
            smooth[:, axes] = 0.0
    return smooth
