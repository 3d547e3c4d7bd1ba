"""A person of round numbers, so that patterns can be tested without building a body."""

import numpy as np

from taichi_cloth.garment.pattern.measures import Figure, Limb, Section


def plain_figure() -> Figure:
    def arm(side: float) -> Limb:
        return Limb(np.array([side * 0.185, 1.40, -0.01]), np.array([side * 0.40, 1.20, -0.01]), 0.05)

    def leg(side: float) -> Limb:
        return Limb(np.array([side * 0.09, 0.9, 0.0]), np.array([side * 0.12, 0.08, 0.0]), 0.09)

    return Figure(
        stature=1.75,
        neck=0.37,
        chest=0.96,
        waist=0.82,
        hip=0.98,
        upper_arm=0.31,
        thigh=0.55,
        shoulder=0.42,
        neck_height=1.49,
        shoulder_height=1.45,
        underarm_height=1.30,
        waist_height=1.09,
        hip_height=0.88,
        crotch_height=0.80,
        sections={
            "chest": Section(0.165, 0.12, 0.0),
            "waist": Section(0.15, 0.105, 0.0),
            "hip": Section(0.175, 0.12, -0.01),
        },
        arms=(arm(1.0), arm(-1.0)),
        legs=(leg(1.0), leg(-1.0)),
    )
