"""The sections of a scene of how its picture is taken: camera, lights, what it stands on, size and number of frames."""

from typing import Literal

from pydantic import Field, model_validator

from ...render.image.tone import Tone
from .section import Section

__all__ = ["Camera", "Light", "Output", "StageSection"]


class Camera(Section):
    elevation_deg: float = Field(default=45.0, ge=-90, le=90, description="height of the camera above the horizon")
    azimuth_deg: float = Field(default=25.0, ge=-3600, le=3600, description="where the first view stands")
    fov_deg: float = Field(default=24.0, ge=1, le=120, description="vertical field of view")
    box_m: tuple[tuple[float, float, float], tuple[float, float, float]] | None = Field(
        default=None,
        description="two corners of what a picture of cloth or a garment frames [m]; default: where it starts",
    )
    follow: bool | None = Field(
        default=None,
        description="whether the camera of an animation goes with the body that wears a garment; default: where it "
        "walks away and no box_m is stated",
    )
    margin: float = Field(default=0.03, ge=0, le=0.45, description="empty share of the frame on each side")
    zoom: float = Field(
        default=1.0, gt=0, le=1e4, description="how much nearer than the framing distance; above 1 crops"
    )
    aim: tuple[float, float] | None = Field(
        default=None,
        description="where a zoom goes: shares of the first picture's width and height, from its upper left; default: "
        "the middle of a cloth, the chest of a garment",
    )


class Light(Section):
    """Lights, and how brightness is made of them. Directions are the viewer's of the first view."""

    key_azimuth_deg: float = Field(default=-68.0, description="from where the key light comes, from the camera's right")
    key_elevation_deg: float = Field(default=38.0, ge=-90, le=90)
    key_strength: float = Field(default=1.5, ge=0, le=1e3)
    key_size_deg: float = Field(default=5.0, ge=0, le=90, description="how wide the key light is: soft shadows")
    fill_strength: float = Field(default=0.5, ge=0, le=1e3)
    zenith: str | None = Field(default=None, description="colour of the sky overhead: a name or #rrggbb")
    horizon: str | None = Field(default=None, description="of the sky at the horizon; default: that of the zenith")
    ground: str | None = Field(default=None, description="of the light that comes back from below")
    rim_strength: float = Field(default=0.0, ge=0, le=1e3, description="a light from behind that makes fibres glow")
    rim_azimuth_deg: float = Field(default=150.0, description="from where the rim light comes")
    rim_elevation_deg: float = Field(default=30.0, ge=-90, le=90)
    follows_camera: bool | None = Field(
        default=None, description="the lights turn with the camera; default: not where a fabric lies still"
    )
    shadows: bool = Field(default=True, description="fibres shadow one another from the key light")
    occlusion: bool = Field(default=True, description="fibres hide the sky from one another")
    shading: Literal["kajiya", "marschner"] = Field(default="marschner", description="model of a fibre's highlight")
    tone: Tone = Field(
        default="shoulder", description="srgb, shoulder, neutral or aces: how bright highlights are kept from clipping"
    )
    exposure: float = Field(default=0.0, ge=-20, le=20, description="in stops")
    background: tuple[str, str] = Field(default=("#f4f2ee", "#cfccc6"), description="top and bottom of the backdrop")
    finish: str | None = Field(default=None, description="how fibres shine; default: the fibre's kind")


class StageSection(Section):
    """What the subject stands or lies on."""

    ground: bool | None = Field(
        default=None, description="a floor with the subject's shadow; default: under fabrics only"
    )


class Output(Section):
    views: int = Field(default=36, ge=1, le=10_000, description="views of a turntable")
    frame: int | None = Field(
        default=None, ge=0, le=100_000, description="of a scene that moves, the one a still shows; default: the last"
    )
    frames: int = Field(default=72, ge=1, le=100_000, description="frames of an animation")
    size: tuple[int, int] = Field(default=(1080, 720), description="width and height [px]")
    fps: int = Field(default=18, ge=1, le=240, description="frames per second of the video")
    webp: bool = Field(default=False, description="also an animated WebP, at most 720 px wide, for a README")

    @model_validator(mode="after")
    def size_fits(self) -> "Output":
        if not all(1 <= n <= 16384 for n in self.size):
            raise ValueError(f"size: {self.size[0]}x{self.size[1]}; allowed: 1x1 to 16384x16384")
        if self.frame is not None and self.frame >= self.frames:
            raise ValueError(f"frame: {self.frame}; allowed: 0 to {self.frames - 1}, for output.frames = {self.frames}")
        return self
