"""The sections of a scene of a garment: its pattern, its cloth, its colours."""

from typing import Annotated, Literal

from pydantic import Field

from taichi_cloth.fabric.follow_rule import FollowRule

from .cloth_schema import MaterialName, MeasuredFile, PropertiesSection
from .section import DRAFT_FILE, PATTERN_FILE, PICTURE_FILE, Positive, Section

__all__ = ["CLEAR", "GarmentSection", "PanelColours", "PrintSection"]


class PanelColours(Section):
    """Thread orders of one panel, such as "navy*4 white*4", counted from the panel's own origin."""

    warp: str | None = None
    weft: str | None = None


class PrintSection(Section):
    """A picture printed on one panel; transparent pixels leave the yarn as it is."""

    file: Annotated[str, PICTURE_FILE] = Field(description="a PNG; each piece of yarn takes the colour it lies under")
    width_cm: Positive | None = Field(default=None, description="default: as wide as the panel [cm]")
    right_cm: float = Field(default=0.0, description="of its middle from the panel's, seen from the right side [cm]")
    up_cm: float = Field(default=0.0, description="of its middle from the panel's [cm]")


CLEAR = ("tshirt", "skirt", "dress", "trousers")
"""Patterns whose garments rest clear of themselves, and all but stay so in built-in motions (`docs/contact.md`): they
are kept from passing through themselves as they move."""


class GarmentSection(Section):
    """A garment cut from [weave] and worn on [body]."""

    pattern: Annotated[str, PATTERN_FILE] = Field(
        default="tshirt",
        description="tshirt, skirt, dress, trousers, a GarmentCode .json file, or a .dxf with a .toml beside it",
    )
    key_points: int | None = Field(
        default=None,
        ge=200,
        le=200_000,
        description="about how many the simulation moves; default: 6,245, or as many as lie 2 cm apart, up to 15,000",
    )
    threads_per_key_point: int = Field(
        default=4, ge=1, le=64, description="threads woven for each key point where no sett is stated in [fabric]"
    )
    ease: float | None = Field(default=None, ge=-0.1, le=1, description="share of the girth; default: the pattern's")
    length_cm: Positive | None = Field(default=None, description="from the neck's side or the waist to the hem [cm]")
    sleeve_cm: Positive | None = Field(default=None, description="from the underarm to the sleeve's hem [cm]")
    flare: Positive | None = Field(default=None, description="girth of the hem over that of the hip")
    material: MaterialName = None
    measured: MeasuredFile = None
    properties: PropertiesSection = PropertiesSection()
    friction: float = Field(default=0.3, ge=0, le=5, description="between cloth and skin")
    gap_mm: float | None = Field(
        default=None,
        ge=0,
        le=30,
        description="kept between the body and the key points [mm]; default: the thickness that is drawn, or what key "
        "points and the body's primitives need",
    )
    colours: dict[str, PanelColours] = Field(default={}, description="of panels by name, instead of the weave's")
    weaves: dict[str, Annotated[str, DRAFT_FILE]] = Field(
        default={}, description="weaves or .wif files by the panel's name, instead of weave.draft"
    )
    prints: dict[str, PrintSection] = Field(default={}, description="pictures on panels, by name")
    hem_mm: float = Field(default=0.0, ge=0, le=80, description="width of the turned hems, a second layer inside [mm]")
    stitches: str | None = Field(default=None, description="colour of the thread along hems and seams; default: none")
    stitch_mm: float = Field(default=2.5, ge=1, le=20, description="from stitch to stitch [mm]")
    thread_mm: float = Field(default=0.35, ge=0.05, le=2, description="diameter of the sewing thread [mm]")
    follow: FollowRule = Field(default="smooth", description='how fibres follow key points; "paper": in world axes')
    representation: Literal["fibre", "mesh"] = Field(default="fibre", description="what is drawn of the same garment")
