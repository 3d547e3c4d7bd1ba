"""What is drawn by us and path traced: a few threads of all their fibres, a camera, lights, and three colours at once.

The colour of every fibre is the case's: red, green and blue are three albedos, each of which light knows nothing of the
others, so that one picture measures three cloths.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ....render.data.camera import Camera, look_at
from ....render.data.finish import Finish
from ....render.data.light import Colour, Lighting
from ....render.data.particles import Particles
from ....render.splat.splat import Splatter
from ...models.build import build
from ...picture.view import finish_of
from ...prepare.fibre_count import EVERY
from ...scene.load import load_scene

__all__ = ["CASES", "QUICK", "YARN", "Case", "Subject", "fibre_starts", "subject_of"]

FOV = 6.0
"""Angle seen over a picture's height [degrees]: nearly parallel."""
SAMPLES = 2
"""Of our picture each way, as `still` takes."""
APART = 1.25
"""Half lengths of a particle, from which on the next one is another fibre's."""
WHITE: Colour = (1.0, 1.0, 1.0)
BLACK: Colour = (0.0, 0.0, 0.0)
COLOURS: Colour = (0.95, 0.6, 0.15)
OTHER_COLOURS: Colour = (0.8, 0.4, 0.05)
THIRD_COLOURS: Colour = (0.7, 0.25, 0.06)


@dataclass(frozen=True, kw_only=True)
class Case:
    """One picture.

    weave: its name, or "yarn" of one yarn. fitted: whether the weights of `render.light.bulk` were found with it. key:
    radiance of a white surface that faces the light; towards: it, any length. fill: of the sky, whose upper half has
    the colour `sky` and the lower one `ground`. away: from the cloth to the eye. share: of the cloth that is seen.
    finer: how many times as many samples the path tracer takes: a yarn has few pixels in each depth, so that its own
    grain would be measured.
    """

    name: str
    weave: str
    fitted: bool
    threads: int = 8
    colour: Colour = COLOURS
    key: float = 1.5
    towards: Colour = (-0.6, 0.8, 0.35)
    fill: float = 0.5
    sky: Colour = WHITE
    ground: Colour = WHITE
    away: Colour = (0.25, 1.0, 0.45)
    share: float = 0.72
    finer: int = 1

    @property
    def lighting(self) -> Lighting:
        return Lighting(
            direction=self.towards,
            key_follows_camera=False,
            key=self.key,
            key_colour=WHITE,
            fill=self.fill,
            sky=self.sky,
            ground=self.ground,
            size=0.0,
            shadows=True,
            occlusion=True,
        )


FLAT = (-0.87, 0.342, 0.355)
"""A light 20° above the cloth."""
BESIDE = (0.5, 1.0, -0.3)
THIRD = (0.75, 0.8, 0.5)
YARN = Case(
    name="one yarn",
    weave="yarn",
    finer=4,
    fitted=True,
    towards=(-0.7, 0.35, 0.6),
    away=(0.0, 0.0, 1.0),
    share=0.9,
)
PLAIN = Case(name="plain", weave="plain", fitted=True)
CASES = (
    PLAIN,
    Case(name="satin", weave="satin-5", threads=10, fitted=True),
    Case(name="twill", weave="twill-2/2", fitted=True),
    YARN,
    replace(PLAIN, name="plain, upper half of the sky", key=0.0, fill=1.0, ground=BLACK),
    replace(PLAIN, name="plain, lower half of the sky", key=0.0, fill=1.0, sky=BLACK),
    replace(PLAIN, name="plain, key in front", fill=0.0, towards=(0.2, 1.0, 0.1)),
    replace(PLAIN, name="plain, key at 20°", fill=0.0, towards=FLAT),
    replace(PLAIN, name="plain, key behind", fill=0.0, towards=(0.3, -0.9, 0.2)),
    Case(name="plain, another view, light and colours", weave="plain", fitted=True, colour=OTHER_COLOURS, key=1.2,
         towards=BESIDE, fill=0.7, away=(-0.7, 1.0, 0.2)),
    Case(name="satin, another view, light and colours", weave="satin-5", threads=10, fitted=True, colour=OTHER_COLOURS,
         key=1.2, towards=BESIDE, fill=0.7, away=(-0.7, 1.0, 0.2)),
    Case(name="basket, window behind", weave="basket-2/2", fitted=True, colour=(0.9, 0.3, 0.08), key=1.0,
         towards=(-0.4, -0.7, -0.6), fill=0.6, ground=(0.4, 0.4, 0.4), away=(0.4, 1.0, -0.5)),
    replace(YARN, name="one yarn, another view, light and colours", fitted=True, colour=OTHER_COLOURS, key=1.2,
            towards=(0.3, 0.8, -0.2), fill=0.7, away=(0.6, 0.4, 0.8)),
    replace(YARN, name="one yarn, light from before it", fitted=True, colour=THIRD_COLOURS, key=1.3,
            towards=(-0.3, 0.6, 0.5), fill=0.6, away=(-0.5, -0.3, 0.8)),
    Case(name="plain, third view, light and colours", weave="plain", fitted=True, colour=THIRD_COLOURS, key=1.3,
         towards=THIRD, fill=0.6, away=(-0.3, 1.0, -0.5)),
    Case(name="twill 3/1, third view, light and colours", weave="twill-3/1", fitted=True, colour=THIRD_COLOURS,
         key=1.3, towards=THIRD, fill=0.6, away=(-0.3, 1.0, -0.5)),
    Case(name="satin of 8, window behind", weave="satin-8", fitted=True, colour=(0.85, 0.4, 0.1), key=1.0,
         towards=(0.5, -0.8, -0.3), fill=0.6, ground=(0.5, 0.5, 0.5), away=(-0.4, 1.0, 0.3)),
    Case(name="herringbone, low light beside", weave="herringbone-2/2", fitted=True, colour=(0.55, 0.85, 0.2), key=1.1,
         towards=(0.8, 0.6, -0.5), fill=0.55, ground=(0.6, 0.6, 0.6), away=(0.35, 1.0, -0.6)),
    replace(YARN, name="one yarn, third view, light and colours", fitted=True, colour=(0.75, 0.3, 0.06), key=1.4,
            towards=(0.4, -0.5, 0.7), fill=0.5, away=(-0.3, 0.25, 0.9)),
    Case(name="twill 2/1, low light before the eye", weave="twill-2/1", threads=9, fitted=True,
         colour=(0.8, 0.45, 0.12), key=1.6, towards=(-0.35, 0.5, -0.9), fill=0.35, ground=(0.3, 0.3, 0.3),
         away=(0.5, 0.75, 0.7)),
    Case(name="basket, high light, pale ground", weave="basket-2/2", fitted=True, colour=(0.5, 0.7, 0.25), key=1.0,
         towards=(-0.3, 1.0, -0.6), fill=0.8, ground=(0.7, 0.6, 0.5), away=(-0.5, 1.0, 0.5)),
    replace(YARN, name="one yarn, low light along it", fitted=True, colour=(0.65, 0.35, 0.09), key=1.5,
            towards=(0.9, 0.25, 0.4), fill=0.4, away=(-0.6, 0.3, 0.7)),
    Case(name="satin of 8, low light opposite", weave="satin-8", fitted=True, colour=(0.9, 0.5, 0.2), key=1.3,
         towards=(0.6, 0.55, -0.7), fill=0.4, ground=(0.5, 0.5, 0.5), away=(-0.5, 0.9, 0.6)),
    replace(YARN, name="one yarn, light from beyond", fitted=True, colour=(0.85, 0.45, 0.15), key=1.4,
            towards=(0.7, 0.5, -0.4), fill=0.5, away=(0.2, 0.5, 0.8)),
    Case(name="plain, low light opposite", weave="plain", fitted=True, colour=(0.6, 0.3, 0.1), key=1.4,
         towards=(0.2, 0.4, -0.9), fill=0.4, ground=(0.3, 0.3, 0.3), away=(-0.1, 0.9, 0.6)),
    Case(name="basket, side light at 30°", weave="basket-2/2", fitted=True, colour=(0.7, 0.12, 0.35), key=1.4,
         towards=(0.85, 0.55, 0.2), fill=0.4, sky=(0.9, 0.95, 1.0), ground=(0.4, 0.35, 0.3), away=(-0.15, 1.0, 0.6)),
    Case(name="twill 1/3, light opposite", weave="twill-1/3", fitted=True, colour=(0.45, 0.8, 0.1), key=1.3,
         towards=(-0.3, 0.7, -0.7), fill=0.5, ground=(0.5, 0.5, 0.5), away=(0.3, 0.9, 0.5)),
    Case(name="herringbone, low light opposite", weave="herringbone-2/2", fitted=True, colour=(0.85, 0.3, 0.07),
         key=1.4, towards=(0.5, 0.42, -0.8), fill=0.4, ground=(0.3, 0.3, 0.3), away=(-0.31, 0.82, 0.7)),
    Case(name="satin of 5, sky over dark ground", weave="satin-5", threads=10, fitted=True, colour=(0.9, 0.3, 0.1),
         key=0.0, fill=1.0, ground=(0.2, 0.2, 0.2), away=(0.5, 0.9, -0.3)),
    Case(name="satin of 8, side light at 22°", weave="satin-8", fitted=True, colour=(0.75, 0.5, 0.25), key=1.5,
         towards=(-0.8, 0.35, -0.35), fill=0.35, ground=(0.5, 0.5, 0.5), away=(-0.2, 1.0, 0.4)),
    replace(YARN, name="one yarn, side light", fitted=True, colour=(0.55, 0.8, 0.12), key=1.3,
            towards=(0.2, 0.9, 0.3), fill=0.5, ground=(0.5, 0.5, 0.5), away=(0.4, 0.15, 0.9)),
    Case(name="plain, denim's colours, light from behind the eye", weave="plain", fitted=True,
         colour=(0.05, 0.15, 0.5), key=1.3, towards=(0.5, 0.8, 0.6), fill=0.5, ground=(0.4, 0.4, 0.4),
         away=(0.4, 1.0, 0.3)),
    Case(name="twill 2/2, window behind", weave="twill-2/2", fitted=True, colour=(0.8, 0.2, 0.5), key=1.0,
         towards=(0.3, -0.8, 0.5), fill=0.6, ground=(0.5, 0.5, 0.5), away=(0.2, 1.0, -0.4)),
    Case(name="twill 2/1, light opposite at 46°", weave="twill-2/1", threads=9, fitted=False, colour=(0.6, 0.2, 0.85),
         key=1.4, towards=(0.35, 0.75, -0.62), fill=0.45, ground=(0.4, 0.4, 0.4), away=(-0.25, 0.9, 0.5)),
    Case(name="satin of 5, low light beside", weave="satin-5", threads=10, fitted=False, colour=(0.35, 0.75, 0.12),
         key=1.4, towards=(-0.85, 0.45, 0.25), fill=0.4, ground=(0.5, 0.5, 0.5), away=(0.3, 1.0, 0.35)),
    Case(name="basket, light from behind the eye", weave="basket-2/2", fitted=False, colour=(0.8, 0.1, 0.3), key=1.3,
         towards=(0.35, 0.85, 0.6), fill=0.45, ground=(0.4, 0.4, 0.4), away=(0.45, 1.0, 0.4)),
    Case(name="herringbone, window behind", weave="herringbone-2/2", fitted=False, colour=(0.7, 0.35, 0.1), key=1.0,
         towards=(-0.5, -0.75, 0.4), fill=0.6, ground=(0.5, 0.5, 0.5), away=(0.3, 1.0, 0.5)),
    replace(YARN, name="one yarn, light behind the eye", fitted=False, colour=(0.3, 0.65, 0.85), key=1.3,
            towards=(-0.4, 0.7, 0.8), fill=0.5, ground=(0.5, 0.5, 0.5), away=(-0.2, 0.3, 0.9)),
    Case(name="plain, low light beside, pale sky", weave="plain", fitted=False, colour=(0.12, 0.5, 0.9), key=1.2,
         towards=(-0.8, 0.4, 0.1), fill=0.6, ground=(0.3, 0.3, 0.3), away=(-0.1, 1.0, -0.45)),
    Case(name="twill 1/3, sky over grey ground", weave="twill-1/3", fitted=False, colour=(0.75, 0.45, 0.15), key=0.0,
         fill=1.0, ground=(0.3, 0.3, 0.3), away=(-0.4, 0.9, 0.4)),
)  # fmt: skip
QUICK = replace(PLAIN, name="plain, 4 × 4 threads", threads=4)


@dataclass(frozen=True, eq=False)
class Subject:
    """The fibres of a case as particles, and who looks at them. starts: of pieces of fibre, and the end, (n + 1,)."""

    case: Case
    particles: Particles
    starts: NDArray[np.int64]
    finish: Finish
    size: int

    @property
    def camera(self) -> Camera:
        return self._camera(self.size)

    def _camera(self, size: int) -> Camera:
        x, away = self.particles.position, np.asarray(self.case.away, np.float64)
        low, high = x.min(axis=0), x.max(axis=0)
        across = (high - low)[1] if self.case.weave == "yarn" else max((high - low)[[0, 2]])
        distance = self.case.share * across / 2 / np.tan(np.radians(FOV / 2))
        middle = (low + high) / 2
        eye = middle + away * (distance / np.linalg.norm(away))
        return look_at(eye, middle, width=size, height=size, fov=FOV, near=1e-4)

    def drawing(self) -> tuple[Splatter, Callable[[], object]]:
        """A splatter and what draws a new pose of the subject with it: particles taken in, light cast, picture."""
        splatter = Splatter(SAMPLES * self.size, SAMPLES * self.size)
        camera, lighting = self._camera(SAMPLES * self.size), self.case.lighting

        def draw() -> None:
            splatter.load(self.particles)
            splatter.render(camera, lighting=lighting, finish=self.finish)

        return splatter, draw

    def taken(self, splatter: Splatter) -> NDArray[np.float64]:
        """The last frame of such a splatter: linear premultiplied RGBA (size, size, 4)."""
        return splatter.linear().astype(np.float64).reshape(self.size, SAMPLES, self.size, SAMPLES, 4).mean(axis=(1, 3))

    def sky_seen(self) -> NDArray[np.float64]:
        """The share of the sky that the fibres of each pixel see, whatever falls on them, (size, size)."""
        splatter, _ = self.drawing()
        camera, everywhere = self._camera(SAMPLES * self.size), Lighting(key=0.0, fill=1.0, sky=WHITE, ground=WHITE)
        splatter.load(self.particles)
        sky = splatter.cast_light(camera, replace(everywhere, occlusion=True)).sky
        assert sky is not None
        seen = sky.seen_from(self.particles.position, self.particles.normal)
        flat = Finish(sheen=0.0, roundness=0.0, specular=0.0, fibre=0.0)
        splatter.load(replace(self.particles, colour=np.repeat(seen[:, None], 3, axis=1), openness=None))
        splatter.render(camera, lighting=everywhere, finish=flat)
        rgba = self.taken(splatter)
        return rgba[..., 0] / np.maximum(rgba[..., 3], 1e-6)


def subject_of(case: Case, size: int) -> Subject:
    """The fibres of a case, without hairs, all of one colour; pictures of them are `size` pixels wide and high."""
    changes = [f"yarn.fibres={EVERY}", "yarn.hairiness.ends_per_m=0", "yarn.hairiness.loops_per_m=0"]
    changes += ["yarn.unevenness=0"]
    if case.weave == "yarn":
        scene = load_scene("yarn", [*changes, "yarn.length_mm=3"])
    else:
        changes += [f"weave.draft={case.weave}", f"weave.ends={case.threads}", f"weave.picks={case.threads}"]
        scene = load_scene("closeup", [*changes, "fabric.irregularity=0", "stage.ground=false"])
    particles = build(scene).panels()[0].particles
    assert isinstance(particles, Particles)
    particles = replace(particles, colour=np.tile(case.colour, (len(particles.radius), 1)))
    assert particles.half_length is not None
    starts = fibre_starts(particles.position, particles.half_length)
    return Subject(case, particles, starts, finish_of(scene), size)


def fibre_starts(position: NDArray[np.float32], half_length: NDArray[np.float32]) -> NDArray[np.int64]:
    """Where fibres start among particles (n, 3) [m] that follow one another along each, and their number at the end."""
    step = np.linalg.norm(np.diff(position, axis=0), axis=1)
    cut = np.flatnonzero(step > APART * half_length[:-1]) + 1
    return np.concatenate([[0], cut, [len(position)]])
