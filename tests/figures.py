"""A person of round numbers, so that patterns can be tested without building a body."""

import numpy as np

from taichi_cloth.garment.fit.landmarks import Landmarks
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


def plain_landmarks() -> Landmarks:
    """A woman of 1.70 m, of round numbers; rings of her legs together and of her trunk, up to the shoulder."""
    height = {"floor": 0.0, "knee": 0.48, "crotch": 0.76, "hip": 0.85, "waist": 1.08, "underbust": 1.17, "bust": 1.24,
              "underarm": 1.25, "shoulder": 1.40, "neck": 1.44, "top": 1.70}  # fmt: skip
    girth = {"hip": 0.97, "waist": 0.72, "underbust": 0.79, "bust": 0.89, "neck": 0.34, "head": 0.57,
             "upper_arm": 0.26, "wrist": 0.155, "thigh": 0.53, "knee": 0.355, "ankle": 0.215}  # fmt: skip
    depth = {"hip": (0.09, -0.13), "waist": (0.105, -0.085), "underbust": (0.105, -0.09), "bust": (0.12, -0.1),
             "neck": (0.05, -0.06), "top": (0.11, -0.095)}  # fmt: skip
    rings = []
    for y in np.arange(0.12, 1.40, 0.01):
        around = np.interp(y, [0.12, 0.48, 0.75, 0.85, 1.08, 1.24, 1.40], [0.655, 0.775, 0.91, 0.97, 0.72, 0.89, 0.95])
        deep = np.interp(y, [0.85, 1.08, 1.24], [0.11, 0.095, 0.11])
        rings.append([y, around, around / np.pi - deep, deep, 0.0])
    arm = np.array([[0.17, 1.36, -0.01], [0.38, 1.17, -0.01], [0.56, 1.02, 0.03]])
    leg = np.array([[0.09, 0.87, -0.02], [0.105, 0.48, -0.02], [0.11, 0.08, -0.03]])
    return Landmarks(height, girth, depth, 0.34, arm, leg, np.array(rings))
