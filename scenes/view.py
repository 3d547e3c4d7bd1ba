"""From a built scene to images: cameras round it, lights and finish as the scene says, panels side by side."""

from collections.abc import Iterator
from dataclasses import replace
from math import cos, radians, sin

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.colour_order import colour

from ..render.camera import Camera, frame, orbit
from ..render.caption import caption, label
from ..render.finish import FINISHES, Finish, finish_for
from ..render.light import Background, Lighting
from ..render.splat import RenderStats, Splatter
from ..render.sprites import CRISP, SOFT, SpriteSheet, fibre_sprite, round_sprite, sheet_from_png
from .models import Model, Panel
from .prepare import fibre_kind
from .schema import Scene

__all__ = ["View", "finish_of", "lighting_of"]

Image = NDArray[np.uint8]


class View:
    """Draws a model at one image size, (width, height) [px].

    Raises InputError or RenderError for a finish, colour or sprite that is not known.
    """

    def __init__(self, model: Model, size: tuple[int, int]) -> None:
        self.model, self.scene, self.size = model, model.scene, size
        self.lighting, self.finish = lighting_of(self.scene), finish_of(self.scene)
        top, bottom = (tuple(float(v) for v in colour(name)) for name in self.scene.light.background)
        self.background = Background(top=top, bottom=bottom)  # pyright: ignore[reportArgumentType]
        self._splatters: list[Splatter] = []
        self._panels: list[Panel] = []

    def turntable(self, count: int, numbers: list[int]) -> Iterator[tuple[int, Image]]:
        """The views `numbers` out of `count` evenly spaced ones, all framed alike."""
        self._load()
        cameras = [
            orbit(
                panel.bounds, count, width=s.width, height=s.height, start=self.scene.camera.azimuth_deg, **self._lens()
            )
            for panel, s in zip(self._panels, self._splatters, strict=True)
        ]
        for k in numbers:
            yield k, self._draw([row[k] for row in cameras])

    def animation(self, numbers: list[int]) -> Iterator[tuple[int, Image]]:
        """The frames `numbers`, in rising order, from one standing camera."""
        for k in numbers:
            self.model.step(k)
            self._load()
            azimuth = self.scene.camera.azimuth_deg
            yield (
                k,
                self._draw(
                    [
                        frame(panel.bounds, width=s.width, height=s.height, azimuth=azimuth, **self._lens())
                        for panel, s in zip(self._panels, self._splatters, strict=True)
                    ]
                ),
            )

    @property
    def stats(self) -> list[RenderStats]:
        """What the last frame took, panel by panel."""
        return [s.stats for s in self._splatters if s.stats is not None]

    def _lens(self) -> dict[str, float]:
        c = self.scene.camera
        return {"elevation": c.elevation_deg, "fov": c.fov_deg, "margin": c.margin}

    def _load(self) -> None:
        self._panels = list(self.model.panels())
        if not self._splatters:
            width, height = self.size
            edges = np.linspace(0, width, len(self._panels) + 1).round().astype(int)
            profile, sheet = _sprite(self.scene)
            self._splatters = [Splatter(max(1, int(w)), height, profile=profile, sprites=sheet) for w in np.diff(edges)]
        for panel, splatter in zip(self._panels, self._splatters, strict=True):
            splatter.load(panel.particles)

    def _draw(self, cameras: list[Camera]) -> Image:
        images = []
        for panel, splatter, camera in zip(self._panels, self._splatters, cameras, strict=True):
            near = replace(camera, focal=camera.focal * self.scene.camera.zoom)
            image = splatter.render(near, lighting=self.lighting, finish=self.finish, background=self.background)
            if panel.caption:
                image = caption(image, panel.caption)
            for name, point in panel.labels:
                x, y, _ = near.project([point])[0]
                image = label(image, name, (float(x), float(y)))
            images.append(image)
        return np.concatenate(images, axis=1)[:, : self.size[0]]


def lighting_of(scene: Scene) -> Lighting:
    """The scene's lights. Directions are the viewer's when the light follows the camera, else the world's."""
    section = scene.light
    azimuth, elevation = radians(section.key_azimuth_deg), radians(section.key_elevation_deg)
    return Lighting(
        direction=(sin(azimuth) * cos(elevation), sin(elevation), cos(azimuth) * cos(elevation)),
        key_follows_camera=section.follows_camera,
        key=section.key_strength,
        fill=section.fill_strength,
        exposure=section.exposure,
    )


def finish_of(scene: Scene) -> Finish:
    """How the scene's fibres answer light: the stated finish, or that of their kind."""
    stated = scene.light.finish or fibre_kind(scene).finish
    return finish_for(stated) if stated in FINISHES or scene.light.finish else Finish()


def _sprite(scene: Scene) -> tuple:
    """(profile, sheet): the analytic alpha, or a texture where the scene names one."""
    name = scene.fibre.sprite
    if name == "thread":
        return CRISP, None
    if name == "soft":
        return SOFT, None
    if name == "round":
        return CRISP, SpriteSheet(np.stack([round_sprite()]))
    if name == "fuzzy":
        return CRISP, SpriteSheet(np.stack([fibre_sprite()]))
    return CRISP, sheet_from_png([name])
