"""The ground a subject lies on: a floor of the background's own colour, of which only the shadows are seen.

So that it has no edge, the floor is not drawn as an object. It is a map of how much darker each place is than an
open floor, which falls off to "not at all", and the background is multiplied by it. The map is seen from above.
What hangs over the floor is cut into layers by height, each a share of the map that is covered. On a place of the
floor a covered area dA at height h, r to the side, takes the share (form factor of parallel surfaces)

    F = h^2 / (pi (h^2 + r^2)^2) dA

of the light of an even sky: a dark line where the subject touches, a soft cloud under what hangs free. The same
layers, pushed away from the key light and blurred as h times the size of the light, are its soft shadow.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ..data.blocks import ParticleBlocks
from ..data.camera import Camera
from ..data.light import Lighting
from ..data.particles import Particles
from ..light.shadow import ShadowMap
from ..tiles.mesh import Mesh

__all__ = ["Stage", "stage_under"]

CELLS = 512
"""Cells of the map along each side."""

LAYERS = (1 / 32, 1 / 16, 1 / 8, 1 / 4, 1 / 2, 1.0)
"""Upper bounds of the layers, in heights of the subject."""

ROOM = 2.4
"""Half side of the map, in half widths of the subject."""

FADE = (0.42, 0.98)
"""Where the floor begins and ends to turn into the background, in half sides of the map."""

SOFTEST = 0.08
"""Least standard deviation of a shadow on the floor, in heights: a map of layers holds no sharper one."""

LOWEST_KEY = 0.2
"""A key light lower than this (sine of its elevation) gives the shadow of one that high, fainter."""

SAMPLES, MANY = 200_000, 500_000
"""Points that stand for a mesh, and particles that stand for those on a device; and for more than so many."""


@dataclass(frozen=True, eq=False)
class Stage:
    """A floor under one pose of a subject. Made by `stage_under`."""

    ground: float
    """Height of the floor, y [m]."""
    centre: tuple[float, float]
    """Middle of the map, x and z [m]."""
    half: float
    """Half side of the map [m]."""
    heights: NDArray[np.float64]
    """Mean height of each layer above the floor [m], shape (layers,)."""
    cover: NDArray[np.float32]
    """Covered share, shape (layers, CELLS, CELLS): rows along z, columns along x."""

    @property
    def cell(self) -> float:
        """Width of a cell of the map [m]."""
        return 2 * self.half / CELLS

    @cached_property
    def sky_blocked(self) -> NDArray[np.float32]:
        """Share 0..1 of an even sky that the subject hides from each place of the floor, (CELLS, CELLS)."""
        padded = (2 * CELLS, 2 * CELLS)
        offset = (np.arange(CELLS + 1) * self.cell) ** 2
        distance = offset[:, None] + offset  # what a place sends is even in x and in z: a quarter of it is enough
        times = np.full(CELLS + 1, 2.0)
        times[[0, CELLS]] = 1.0
        total = np.zeros((2 * CELLS, CELLS + 1), np.complex128)
        below = np.ones((CELLS, CELLS), np.float32)
        heights = np.maximum(self.heights, 0.7 * self.cell)
        for height in np.unique(heights):  # of a flat subject most layers are as low as can be told: one for all
            seen = np.zeros((CELLS, CELLS), np.float32)
            for cover in self.cover[heights == height]:
                seen += cover * below
                below *= 1 - cover  # what is seen from below hides what is above it
            kernel = height**2 / np.pi / (height**2 + distance) ** 2 * self.cell**2
            kernel /= max(1.0, float(times @ kernel @ times))
            for axis in (1, 0):
                kernel = np.fft.irfft(kernel, 2 * CELLS, axis, norm="forward").take(np.arange(CELLS + 1), axis)
            total += np.fft.rfft2(seen, padded) * np.concatenate([kernel, kernel[-2:0:-1]])
        blocked = np.fft.irfft2(total, padded)[:CELLS, :CELLS]
        return np.clip(blocked, 0, 1).astype(np.float32)

    def key_passing(self, towards: NDArray[np.float64], size_deg: float = 6.0) -> NDArray[np.float32]:
        """Share 0..1 of a light from the unit direction `towards`, `size_deg` wide, that reaches each place,
        (CELLS, CELLS)."""
        softness = max(SOFTEST, np.tan(np.radians(size_deg) / 2))
        slope = towards[[0, 2]] / max(float(towards[1]), LOWEST_KEY)
        passing = np.ones((CELLS, CELLS), np.float32)
        for height, cover in zip(self.heights, self.cover, strict=True):
            shift = -slope * height / self.cell
            there = np.array([[1, 0, shift[0]], [0, 1, shift[1]]])
            moved = cv2.warpAffine(cover, there, (CELLS, CELLS), flags=cv2.INTER_LINEAR)
            sigma = max(0.8, softness * height / self.cell)
            passing *= 1 - np.clip(cv2.GaussianBlur(moved, (0, 0), sigma), 0, 1)
        return passing

    def key_mapped(self, key: ShadowMap) -> NDArray[np.float32]:
        """The same from a shadow map of the subject, which knows single threads, (CELLS, CELLS)."""
        place = (np.arange(CELLS, dtype=np.float32) + np.float32(0.5)) * np.float32(self.cell) - np.float32(self.half)
        points = np.empty((CELLS, CELLS, 3), np.float32)
        points[..., 0] = place + np.float32(self.centre[0])
        points[..., 1] = self.ground
        points[..., 2] = place[:, None] + np.float32(self.centre[1])
        passing = key.shadow_at(points.reshape(-1, 3), lag=key.texel).reshape(CELLS, CELLS)
        return cv2.GaussianBlur(passing, (0, 0), 0.6).astype(np.float32)

    def darkening(self, camera: Camera, lighting: Lighting, key_map: ShadowMap | None = None) -> NDArray[np.float32]:
        """Light on the floor relative to an open one, 0..1 a colour, shape (CELLS, CELLS, 3); 1 at the borders.

        key_map: of the subject under the key light; without it the layers throw the shadow.
        Kept for the next picture under the same light.
        """
        towards = lighting.towards_key(camera)
        light, map_of, found = self._darkened.get("last", (None, None, None))
        if found is not None and light == (lighting, towards.tolist()) and map_of is key_map:
            return found
        key, sky = lighting.radiances()[0], lighting.ambient(1.0)
        key = key * max(float(towards[1]), 0.0)
        passing = self.key_passing(towards, lighting.size) if key_map is None else self.key_mapped(key_map)
        lit = key * passing[..., None] + sky * (1 - self.sky_blocked)[..., None]
        place = (np.arange(CELLS) + 0.5) / CELLS * 2 - 1
        far = np.clip((np.hypot(place[:, None], place) - FADE[0]) / (FADE[1] - FADE[0]), 0, 1)
        fade = 1 - far**2 * (3 - 2 * far)
        found = (1 - fade[..., None] * (1 - lit / np.maximum(key + sky, 1e-12))).astype(np.float32)
        self._darkened["last"] = (lighting, towards.tolist()), key_map, found
        return found

    @cached_property
    def _darkened(self) -> dict[str, Any]:
        """Under which light, by which map of it, the last `darkening`."""
        return {}


def stage_under(particles: Particles | ParticleBlocks, mesh: Mesh | None = None) -> Stage | None:
    """The floor under particles and a mesh, level with their lowest points; None when there is nothing.

    The lowest five thousandths of the particles may reach through it: single hairs do not lift a cloth.
    """
    each = step = 1
    if isinstance(particles, ParticleBlocks):
        particles, each = particles.some(SAMPLES)
    elif len(particles) > MANY:
        each = step = -(-len(particles) // MANY) | 1  # odd: of a crossing there are mostly an even number
    place, radius, half_length = particles.position[::step], particles.radius[::step], particles.half_length
    half_length = None if half_length is None else half_length[::step]
    drawn = np.isfinite(place).all(axis=1) & (radius > 0) & np.isfinite(radius)
    place, radius = place[drawn].astype(np.float64), radius[drawn].astype(np.float64)
    area = np.pi * radius**2
    if half_length is not None:
        area = 2 * radius * np.maximum(half_length[drawn], radius) / 1.5  # chains overlap
    area *= each
    low = float(np.quantile(place[:, 1] - radius, 0.005)) if len(place) else np.inf
    if mesh is not None:
        points, share = _on_mesh(mesh)
        if len(points):
            low = min(low, float(points[:, 1].min()))
            place, area = np.concatenate([place, points]), np.concatenate([area, share])
    if not len(place):
        return None
    least, most = place.min(axis=0), place.max(axis=0)
    height = max(float(most[1]) - low, 1e-9)
    half = ROOM * max(float((most - least)[[0, 2]].max()) / 2, 0.3 * height)
    centre = ((least + most) / 2)[[0, 2]]
    cell = 2 * half / CELLS
    up = np.clip(place[:, 1] - low, 0, height)
    layer = np.searchsorted(np.array(LAYERS) * height, up * (1 - 1e-9))
    column, row = (np.floor((place[:, k] - c + half) / cell).astype(int) for k, c in zip((0, 2), centre, strict=True))
    flat = (layer * CELLS + row.clip(0, CELLS - 1)) * CELLS + column.clip(0, CELLS - 1)
    layers = len(LAYERS)
    total = np.bincount(flat, area, layers * CELLS * CELLS).reshape(layers, CELLS, CELLS)
    count = np.bincount(layer, minlength=layers)
    heights = np.bincount(layer, up, layers) / np.maximum(count, 1)
    blur = max(0.5 * float(np.sqrt(area.mean() / np.pi)) / cell, 0.5)
    covered = [1 - np.exp(-cv2.GaussianBlur(one, (0, 0), blur) / cell**2) for one in total]
    used = count > 0
    return Stage(
        low, (float(centre[0]), float(centre[1])), half, heights[used], np.stack(covered)[used].astype(np.float32)
    )


def _on_mesh(mesh: Mesh) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Points spread evenly over a mesh (n, 3), always the same ones, and the area of each seen from above (n,)."""
    corner = mesh.vertices[mesh.faces].astype(np.float64)
    corner = corner[np.isfinite(corner).all(axis=(1, 2))]
    cross = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]) / 2
    area = np.linalg.norm(cross, axis=1)
    if not area.sum() > 0:
        return np.zeros((0, 3)), np.zeros(0)
    random = np.random.Generator(np.random.Philox(key=[0, 11]))
    pick = np.searchsorted(np.cumsum(area) / area.sum(), (np.arange(SAMPLES) + 0.5) / SAMPLES).clip(0, len(area) - 1)
    a, b = random.random((2, SAMPLES, 1))
    a, b = np.where(a + b > 1, 1 - a, a), np.where(a + b > 1, 1 - b, b)
    base, one, two = corner[pick, 0], corner[pick, 1], corner[pick, 2]
    level = np.abs(cross[pick, 1]) / area[pick] * area.sum() / SAMPLES
    return base + a * (one - base) + b * (two - base), level
