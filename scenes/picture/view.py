"""From a built scene to images: cameras round it, lights and finish as the scene says, panels side by side."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import cos, radians, sin

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.detail.cell_stream import TARGET, CellStream
from taichi_cloth.ground.copies import fetched
from taichi_cloth.weave.colour_order import colour

from ...render.data.backdrop import Backdrop
from ...render.data.blocks import ParticleBlocks
from ...render.data.camera import Camera, frame, orbit
from ...render.data.finish import FINISHES, Finish, finish_for
from ...render.data.light import Background, KeyLight, Lighting
from ...render.data.sprites import CRISP, SOFT, SpriteSheet, fibre_sprite, round_sprite, sheet_from_png
from ...render.image.caption import caption, label
from ...render.image.tone import tone_inverse
from ...render.splat.drawn import RenderStats
from ...render.splat.splat import Splatter
from ...render.stage.paint import paint
from ...render.stage.stage import Stage, stage_under
from ...render.tiles.mesh import Mesh, join
from ..models.model import Model, Panel
from ..prepare.drawing import has_floor
from ..prepare.yarns import fibre_kind, yarn_of
from ..scene.schema import Scene
from .samples import SAMPLES, averaged, over, samples_of, shown
from .sheet_look import fit_look
from .streamed import Streamed

__all__ = ["Shot", "View", "finish_of", "first_of", "lighting_of"]

Image = NDArray[np.uint8]


@dataclass(frozen=True)
class Shot:
    """A panel that was just drawn: its camera, what stands behind, and the splatter that holds it."""

    panel: Panel
    splatter: Splatter
    camera: Camera
    backdrop: Backdrop | None
    mesh: Mesh | None = None
    linear: NDArray[np.float32] | None = None
    """Of a panel that came in batches: what `Splatter.linear` gives of one that came whole."""
    scale: int = 1
    """Pixels of all this along each side of one of the picture."""


class View:
    """Draws a model at one image size, (width, height) [px], or pictures `scale` times as large each way. Where it is 1
    fibres finer than half a pixel have several samples a pixel (`samples_of`).

    Raises InputError or InputError for a finish, colour or sprite that is not known.
    """

    def __init__(self, model: Model, size: tuple[int, int], *, scale: int = 1) -> None:
        self.model, self.scene, self.size, self.scale = model, model.scene, size, scale
        self.lighting, self.finish = lighting_of(self.scene), finish_of(self.scene)
        top, bottom = (tuple(float(v) for v in colour(name)) for name in self.scene.light.background)
        ends = (tuple(tone_inverse(self.lighting.tone, end).tolist()) for end in (top, bottom))
        self.background = Background(**dict(zip(("top", "bottom"), ends, strict=True)))
        self._splatters: list[Splatter] = []
        self._sizes: list[tuple[int, int]] = []
        self._samples: list[int] = []
        self._panels: list[Panel] = []
        self._stages: list[Stage | None] = []
        self._streamed: list[Streamed | None] = []
        self._within: list[list[tuple[Streamed, CellStream, Finish]]] = []
        self._meshes: list[Mesh | None] = []
        self._own: dict[int, Splatter] = {}
        self._fitted: list[CellStream] = []

    def turntable(self, count: int, numbers: list[int]) -> Iterator[tuple[int, Image]]:
        """The views `numbers` out of `count` evenly spaced ones, all framed alike."""
        self._load()
        cameras = [
            orbit(panel.bounds, count, width=w, height=h, start=self.scene.camera.azimuth_deg, **_lens(self.scene))
            for panel, (w, h) in zip(self._panels, self._sizes, strict=True)
        ]
        for k in numbers:
            yield k, self._draw([row[k] for row in cameras])

    def shots(self) -> Iterator[Shot]:
        """The panels as the first view of a turntable shows them, drawn one after the other, without words."""
        self._load()
        for k, camera in enumerate(self._first()):
            yield self._shoot(k, camera, linear=True)[0]

    def bare_shots(self, most: int = 1) -> Iterator[Shot]:
        """The same without shadows, occlusion and floor, normals as they are, for passes; what comes in batches is not
        drawn. most: samples of a pixel along each side."""
        self.lighting = Lighting()
        self._load(most)
        self._panels = [replace(panel, to_eye=0.0) for panel in self._panels]
        self._stages = [None for _ in self._panels]
        for k, camera in enumerate(self._first()):
            if self._panels[k].source is None:
                yield self._shoot(k, camera)[0]
            else:
                near, mesh = self._near(camera), self._meshes[k]
                behind = paint(near, mesh=mesh, lighting=self.lighting, background=self.background, samples=2)
                yield Shot(self._panels[k], self._splatters[k], near, behind, mesh, scale=self.scale)

    def camera(self) -> Camera:
        """That of an animation, for the first panel, without the scene's zoom."""
        self._load()
        azimuth, (width, height) = self.scene.camera.azimuth_deg, self._sizes[0]
        return frame(self._panels[0].bounds, width=width, height=height, azimuth=azimuth, **_lens(self.scene))

    def seen_by(self, camera: Camera) -> Image:
        """The first panel as it is now, from any camera of the image's size."""
        self._load()
        return self._shoot(0, camera)[1]

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
                        frame(panel.bounds, width=w, height=h, azimuth=azimuth, **_lens(self.scene))
                        for panel, (w, h) in zip(self._panels, self._sizes, strict=True)
                    ]
                ),
            )

    @property
    def stats(self) -> list[RenderStats]:
        """What the last frame took, panel by panel."""
        return [s.stats for s in self._splatters if s.stats is not None]

    def _first(self) -> Iterator[Camera]:
        """The first view of a turntable, panel by panel."""
        for panel, size in zip(self._panels, self._sizes, strict=True):
            yield first_of(self.scene, size, panel.bounds)

    def _near(self, camera: Camera) -> Camera:
        """As near as the scene's zoom says."""
        return replace(camera, focal=camera.focal * self.scene.camera.zoom)

    def _load(self, most: int = SAMPLES) -> None:
        """Take the model's panels as they are now. most: samples of a pixel along each side."""
        self._panels = list(self.model.panels())
        if not self._splatters:
            edges = np.linspace(0, self.size[0], len(self._panels) + 1).round().astype(int)
            self._sizes = [(max(1, int(w)) * self.scale, self.size[1] * self.scale) for w in np.diff(edges)]
            near = zip(self._panels, map(self._near, self._first()), strict=True)
            self._samples = [min(most, samples_of(panel, camera)) if self.scale == 1 else 1 for panel, camera in near]
            profile, sheet = _sprite(self.scene)
            self._splatters = [
                Splatter(n * width, n * height, profile=profile, sprites=sheet)
                for n, (width, height) in zip(self._samples, self._sizes, strict=True)
            ]
        self._meshes = [join(panel.meshes) if panel.meshes else None for panel in self._panels]
        on = has_floor(self.scene)
        self._stages, self._streamed = [], []
        both = zip(self._panels, self._splatters, strict=True)
        self._within = [[self._inner(one, splatter) for one in panel.within] for panel, splatter in both]
        for panel, splatter, mesh in zip(self._panels, self._splatters, self._meshes, strict=True):
            if panel.source is not None:
                self._streamed.append(self._stream(panel, splatter, mesh, floor=on))
                self._stages.append(None)
                continue
            splatter.load(panel.particles, mesh)
            self._streamed.append(None)
            self._stages.append(stage_under(panel.particles, mesh) if on else None)

    def _stream(self, panel: Panel, splatter: Splatter, mesh: Mesh | None, *, floor: bool) -> Streamed:
        """What draws a panel that comes in batches."""
        assert isinstance(panel.particles, ParticleBlocks)
        if isinstance(panel.source, CellStream):
            panel.source.target = TARGET * self.scale
            if not any(panel.source is one for one in self._fitted):  # it stays the same while cloth moves
                panel.source.look = fit_look(panel.source, self._finish(panel))
                self._fitted.append(panel.source)
        shading = join(panel.shading) if panel.shading else None
        return Streamed(splatter, panel.particles, floor=floor, mesh=mesh, shading=shading)

    def _inner(self, panel: Panel, like: Splatter) -> tuple[Streamed, CellStream, Finish]:
        """What draws a panel that is drawn before another, on a splatter of its own as large as that one's."""
        assert isinstance(panel.source, CellStream)
        own = self._own.get(id(panel.source)) or Splatter(like.width, like.height, profile=like.profile)
        self._own[id(panel.source)] = own
        mesh = join(panel.meshes) if panel.meshes else None
        return self._stream(panel, own, mesh, floor=False), panel.source, self._finish(panel)

    def _finish(self, panel: Panel) -> Finish:
        finish = self.finish if panel.scene is None else finish_of(panel.scene)
        return replace(finish, to_eye=panel.to_eye)

    def _draw(self, cameras: list[Camera]) -> Image:
        images = []
        for k, (panel, camera) in enumerate(zip(self._panels, cameras, strict=True)):
            shot, image = self._shoot(k, camera)
            if panel.caption:
                image = caption(image, panel.caption)
            for name, point in panel.labels:
                x, y, _ = shot.camera.project([point])[0]
                image = label(image, name, (float(x), float(y)))
            images.append(image)
        return np.concatenate(images, axis=1)[:, : self.size[0] * self.scale]

    def _shoot(self, k: int, camera: Camera, *, linear: bool = False) -> tuple[Shot, Image]:
        """Draw panel k, the camera as near as the scene's zoom says. linear: keep what batches make of it."""
        splatter, panel, streamed = self._splatters[k], self._panels[k], self._streamed[k]
        near = self._near(camera)
        light, ground, finish = self.lighting, self.background, self._finish(panel)
        if streamed is not None and panel.source is not None:
            options = {"lighting": light, "background": ground}
            before = None
            for inner, source, own in self._within[k]:
                rgba = np.zeros((near.height, near.width, 4), np.float32)
                _, behind = inner.draw(near, source, finish=own, linear=rgba, drawn=before, **options)
                assert behind is not None
                before = rgba[..., :3] + (1 - rgba[..., 3:]) * fetched(behind.colour)[:, : near.width]
            rgba = np.zeros((near.height, near.width, 4), np.float32) if linear else None
            image, backdrop = streamed.draw(
                near, panel.source, finish=self._finish(panel), linear=rgba, drawn=before, **options
            )
            return Shot(panel, splatter, near, backdrop, linear=rgba, scale=self.scale), image
        mesh, floor, samples = self._meshes[k], self._stages[k], self._samples[k]
        near = near.on_canvas(samples)
        maps = splatter.cast_light(near, light) if mesh is not None or floor is not None else None
        backdrop = paint(
            near, mesh=mesh, stage=floor, lighting=light, background=ground, maps=maps, samples=2 // samples
        )
        image = splatter.render(near, lighting=light, finish=finish, background=ground, backdrop=backdrop)
        shot = Shot(panel, splatter, near, backdrop, mesh, scale=self.scale * samples)
        if samples > 1:
            image = shown(light.tone, averaged(self.light_of(shot), samples))
        return shot, image

    def light_of(self, shot: Shot) -> NDArray[np.float32]:
        """Linear colour (h, w, 3) of a shot over what stands behind it, on its own canvas."""
        rgba, height = shot.splatter.linear() if shot.linear is None else shot.linear, shot.camera.height
        if shot.backdrop is not None:
            behind = fetched(shot.backdrop.colour)[:, : shot.camera.width]
        else:
            ends = self.background.ends()
            behind = ends[:3] + (ends[3:] - ends[:3]) * ((np.arange(height) + 0.5) / height)[:, None, None]
        return over(rgba, behind)


def first_of(scene: Scene, size: tuple[int, int], bounds: NDArray) -> Camera:
    """The first camera of a turntable, before the scene's zoom. bounds: the points that must be in it, see `Panel`."""
    (width, height), start = size, scene.camera.azimuth_deg
    return orbit(bounds, 1, width=width, height=height, start=start, **_lens(scene))[0]


def _lens(scene: Scene) -> dict[str, float]:
    c = scene.camera
    return {"elevation": c.elevation_deg, "fov": c.fov_deg, "margin": c.margin}


def lighting_of(scene: Scene) -> Lighting:
    """The scene's lights. They stay where they are for the first view, or turn with the camera."""
    section = scene.light
    follows = section.follows_camera
    if follows is None:
        follows = scene.subject not in ("fabric", "cloth")

    def direction(azimuth_deg: float, elevation_deg: float) -> tuple[float, float, float]:
        azimuth = radians(azimuth_deg + (0.0 if follows else scene.camera.azimuth_deg))
        elevation = radians(elevation_deg)
        return sin(azimuth) * cos(elevation), sin(elevation), cos(azimuth) * cos(elevation)

    rim = KeyLight(
        direction=direction(section.rim_azimuth_deg, section.rim_elevation_deg),
        intensity=section.rim_strength,
        follows_camera=follows,
        size=section.key_size_deg,
        casts_shadow=section.shadows,
    )
    named = (("sky", section.zenith), ("horizon", section.horizon), ("ground", section.ground))
    dome = {key: tuple(float(v) for v in colour(name)) for key, name in named if name is not None}
    return Lighting(
        **dome,  # pyright: ignore[reportArgumentType]
        direction=direction(section.key_azimuth_deg, section.key_elevation_deg),
        key_follows_camera=follows,
        key=section.key_strength,
        fill=section.fill_strength,
        exposure=section.exposure,
        size=section.key_size_deg,
        shadows=section.shadows,
        occlusion=section.occlusion,
        others=(rim,) if section.rim_strength > 0 else (),
        tone=section.tone,
    )


def finish_of(scene: Scene) -> Finish:
    """How the scene's fibres answer light: the stated finish, or that of their kind."""
    stated = scene.light.finish or fibre_kind(scene).finish
    finish = finish_for(stated) if stated in FINISHES or scene.light.finish else Finish()
    return replace(finish, model=scene.light.shading, depth=_depth(scene))


def _depth(scene: Scene) -> float:
    """How deep the scene's fibres lie together [m]: two yarns, as in a cloth, of a yarn alone too; 0 of a fibre."""
    if scene.yarn is None:
        return 0.0
    fibre = fibre_kind(scene)
    one = yarn_of(scene.yarn, fibre).woven_diameter
    if scene.subject in ("yarn", "twist"):
        return 2.0 * one
    return one + yarn_of(scene.weft_yarn or scene.yarn, fibre).woven_diameter


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
