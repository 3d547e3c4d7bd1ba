"""A yarn while it is twisted (paper 2.2.3)."""

import numpy as np

from taichi_cloth.ground.particles import FibreCloud
from taichi_cloth.weave.colour_order import colour
from taichi_cloth.yarn.twisting import TwistingYarn

from ..prepare.fibre_count import EVERY
from ..prepare.yarns import fibre_kind, yarn_of
from ..scene.schema import Scene
from .facts import Fact, yarn_facts
from .model import Numbers, Panel, particles_of

__all__ = ["TwistModel"]


class TwistModel:
    """Two singles being twisted: the zones a and b of the paper's Figures 3 and 4."""

    def __init__(self, scene: Scene) -> None:
        assert scene.yarn is not None
        assert scene.twist is not None
        self.scene, self.frames = scene, scene.output.frames
        section = scene.twist
        self.yarn = yarn_of(scene.yarn, fibre_kind(scene))
        sign = 1.0 if scene.yarn.twist == "Z" else -1.0
        self.twisting = TwistingYarn(
            self.yarn,
            a=section.zone_a_mm * 1e-3,
            b=section.zone_b_mm * 1e-3,
            speed=section.speed_mm_per_s * 1e-3,
            spin_speed=sign * section.turns_per_s,
            duration=section.duration_s,
            feed=section.feed_mm * 1e-3,
            fibres=min(scene.yarn.fibres or EVERY, self.yarn.fibres_in_section),
            construction=scene.yarn.construction,
            colours=np.stack([colour(name) for name in section.colours]),
            seed=scene.seed,
        )
        t = self.twisting
        self.nips = [_nip(x, 1.25 * self.yarn.diameter) for x in (0.0, t.a, t.a + t.b)]
        low, high = -t.feed, t.a + t.b + t.feed
        reach = 2.2 * self.yarn.diameter
        self.bounds = np.array(
            [[x - (t.a + t.b) / 2, y, 0.0] for x in (low, high) for y in (-reach, reach)], np.float32
        )

    def step(self, frame: int) -> None:
        """Twist on to the time of a frame; frames are spread evenly over the stated duration."""
        self.twisting.step_to(
            self.scene.twist.duration_s * frame / max(1, self.frames - 1) if self.scene.twist else 0.0
        )

    def panels(self) -> list[Panel]:
        t = self.twisting
        cloud = FibreCloud.joined([t.cloud(), *self.nips])
        cloud.position[:, 0] -= (t.a + t.b) / 2
        twist_a, twist_b = t.twist
        caption = (
            f"t = {t.time:5.2f} s    zone a (A-B): {1e-2 * twist_a:+6.2f} turns/cm    "
            f"zone b (B-C): {1e-2 * twist_b:+6.2f} turns/cm"
        )
        middle, below = (t.a + t.b) / 2, -1.9 * self.yarn.diameter
        places = (("A", 0.0), ("zone a", t.a / 2), ("B", t.a), ("zone b", t.a + t.b / 2), ("C", t.a + t.b))
        labels = tuple((name, (x - middle, below, 0.0)) for name, x in places)
        return [Panel(particles_of(cloud), self.bounds, caption, labels, self.numbers)]

    def numbers(self) -> Numbers:
        """Yarn: the single that a particle is of, none for the rings. Part: 0 yarn, 1 the rings at A, B and C."""
        ply = self.twisting.singles()
        rings = sum(len(ring.radius) for ring in self.nips)
        yarn = np.concatenate([ply, np.full(rings, -1)]).astype(np.int32)
        part = np.concatenate([np.zeros(len(ply)), np.ones(rings)]).astype(np.int32)
        yarns: dict[int, dict[str, str | int]] = {k: {"system": "single", "index": k} for k in range(self.yarn.plies)}
        return Numbers(yarn, part, yarns, {0: "yarn", 1: "rings"})

    def facts(self) -> list[Fact]:
        section = self.scene.twist
        assert section is not None
        facts = yarn_facts(self.yarn)
        if section.speed_mm_per_s > 0:
            steady = 10 * section.turns_per_s / section.speed_mm_per_s
            facts.append(Fact("twist of zone a in the end", f"{steady:.2f} turns/cm", "s/V; zone b: 0"))
        return facts


def _nip(x: float, radius: float, count: int = 900) -> FibreCloud:
    """A dark ring about the yarn at x: where it is fed, twisted or taken up."""
    angle = 2 * np.pi * np.arange(count) / count
    zero, one = np.zeros(count), np.ones(count)
    out = np.stack([zero, np.cos(angle), np.sin(angle)], -1).astype(np.float32)
    return FibreCloud(
        position=(out * radius + np.array([x, 0, 0])).astype(np.float32),
        tangent=np.stack([zero, -np.sin(angle), np.cos(angle)], -1).astype(np.float32),
        normal=out,
        colour=np.tile(np.array([[0.03, 0.03, 0.035]], np.float32), (count, 1)),
        radius=(0.07 * radius * one).astype(np.float32),
        half_length=(0.07 * radius * one).astype(np.float32),
        openness=one.astype(np.float32),
    )
