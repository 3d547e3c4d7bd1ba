"""The sections of a scene whose cloth moves: the sheet, what holds it, what acts on it, and how it is solved."""

from typing import Annotated, Literal, get_args

from pydantic import Field, field_validator, model_validator

from taichi_cloth.body.skin.names import JOINTS
from taichi_cloth.fabric.follow_rule import FollowRule
from taichi_cloth.ground.errors import did_you_mean
from taichi_cloth.sheet.springs import BendingLaw

from .section import MEASURED_FILE, Positive, Section, Share

__all__ = [
    "BodyPinSection",
    "ClothSection",
    "ForcesSection",
    "MaterialName",
    "MeasuredFile",
    "PinsSection",
    "PropertiesSection",
    "SolverSection",
]

Edge = Literal["left", "right", "top", "bottom"]
Corner = Literal["top-left", "top-right", "bottom-left", "bottom-right"]
Vector = tuple[float, float, float]
Within = Literal["couple", "shear-hysteresis", "torsion", "locking"]
AS_DRAWN = "default: as thick as the cloth is drawn, or what its key points can keep"

MaterialName = Annotated[
    str | None,
    Field(
        description="woven, of [yarn], [weave] and their sett, or a preset, such as silk-habotai, wool-suiting, denim; "
        "default: woven where fabric.ends_per_cm and picks_per_cm are stated, else cotton-shirting"
    ),
]
MeasuredFile = Annotated[
    str | None,
    MEASURED_FILE,
    Field(description="a .toml file of properties as KES, FAST or a cantilever measure them, in their place"),
]


class PropertiesSection(Section):
    """Of the fabric as a sheet, instead of the preset's."""

    tensile_warp_n_per_m: Positive | None = Field(default=None, description="force per width and strain [N/m]")
    tensile_weft_n_per_m: Positive | None = None
    drawn_warp_n_per_m: Positive | None = Field(default=None, description="once its crimp is drawn out [N/m]")
    drawn_weft_n_per_m: Positive | None = None
    crimp_warp_percent: float | None = Field(default=None, ge=0, le=100, description="strain at which that is [%]")
    crimp_weft_percent: float | None = Field(default=None, ge=0, le=100)
    shear_n_per_m: float | None = Field(default=None, ge=0, description="force per width and radian [N/m]")
    bending_warp_un_m: float | None = Field(default=None, ge=0, description="bending rigidity [µN·m]")
    bending_weft_un_m: float | None = Field(default=None, ge=0)
    couple_warp_mn: float | None = Field(default=None, ge=0, description="bending hysteresis, KES's 2HB [mN]")
    couple_weft_mn: float | None = Field(default=None, ge=0)
    torsion_un_m: float | None = Field(default=None, ge=0, description="torsion J of both families [µN·m]")
    shear_hysteresis_n_per_m: float | None = Field(default=None, ge=0, description="shear hysteresis, KES's 2HG [N/m]")
    locking_angle_deg: float | None = Field(
        default=None, ge=0, lt=89, description="shear angle at which neighbouring threads touch [°]"
    )
    within: Literal["none", "all"] | tuple[Within, ...] = Field(
        default="none",
        description="what moves as well of what the fabric has beside springs: couple (bending hysteresis), "
        'shear-hysteresis, torsion, locking; "all" of them takes about a fifth longer. A number above adds its own',
    )
    density_g_per_m2: Positive | None = None
    air_damping_per_s: float | None = Field(default=None, ge=0, description="share of the velocity lost [1/s]")
    fibre_damping_ms: float | None = Field(default=None, ge=0, description="lag of the stress in the threads [ms]")

    @property
    def numbers(self) -> dict[str, float]:
        """Those that are stated, by key."""
        return {key: value for key, value in self.model_dump(exclude={"within"}).items() if value is not None}

    @property
    def wanted(self) -> tuple[Within, ...]:
        """`within` by names."""
        if isinstance(self.within, str):
            return get_args(Within) if self.within == "all" else ()
        return self.within

    @model_validator(mode="before")
    @classmethod
    def share_is_gone(cls, data: object) -> object:
        if isinstance(data, dict) and "tensile_share" in data:
            raise ValueError(
                "there is no tensile_share any more: threads of any stiffness cost the same; leave it out, and name "
                "[forces.strain_limit] if they may grow by no more than that"
            )
        return data


class BodyPinSection(Section):
    """A rectangle of key points attached to a bone and carried with it. Shares count from the left and the bottom."""

    bone: str = Field(description="a joint of the body, such as spine3, clavicle_l, head")
    columns: tuple[Share, Share] = Field(default=(0.0, 1.0), description="from where to where, in shares of the width")
    rows: tuple[Share, Share] = Field(default=(0.0, 1.0), description="likewise, of the length")

    @model_validator(mode="after")
    def known_bone(self) -> "BodyPinSection":
        if self.bone not in JOINTS:
            raise ValueError(f"bone {self.bone!r}; known: {', '.join(JOINTS)}{did_you_mean(self.bone, JOINTS)}")
        if self.columns[0] > self.columns[1] or self.rows[0] > self.rows[1]:
            raise ValueError("columns, rows: allowed: the lesser share first")
        return self


class PinsSection(Section):
    """Key points that are held. `pull_mm` moves the right edge away from the left one, half of it on each side."""

    edges: tuple[Edge, ...] = ()
    corners: tuple[Corner, ...] = ()
    pull_mm: float = Field(default=0.0, ge=0, le=1e5, description="how far left and right edge are pulled apart [mm]")
    pull_s: Positive = Field(default=1.0, description="how long that takes [s]")
    body: tuple[BodyPinSection, ...] = Field(default=(), description="regions that the body carries; needs [body]")

    @model_validator(mode="after")
    def pull_needs_hands(self) -> "PinsSection":
        if self.pull_mm and not {"left", "right"} <= set(self.edges):
            raise ValueError('pull_mm pulls edges "left" and "right" apart; name both in edges')
        return self


class ClothSection(Section):
    """A rectangular sheet on a grid of key points: columns along the weft, rows along the warp."""

    width_m: float = Field(default=1.0, gt=0, le=100, description="along the weft [m]")
    length_m: float = Field(default=1.0, gt=0, le=100, description="along the warp [m]")
    columns: int = Field(default=79, ge=3, le=4000, description="key points along the weft")
    rows: int = Field(default=79, ge=3, le=4000, description="key points along the warp")
    threads_per_key_point: int = Field(
        default=1, ge=1, le=1000, description="threads woven for each key point where no sett is stated in [fabric]"
    )
    material: MaterialName = None
    measured: MeasuredFile = None
    properties: PropertiesSection = PropertiesSection()
    bending: BendingLaw = Field(default="hinge", description='"spring" is the paper\'s')
    follow: FollowRule = Field(default="smooth", description='how fibres follow key points; "paper": in world axes')
    representation: Literal["fibre", "mesh"] = Field(default="fibre", description="what is drawn of the same sheet")
    hang: Literal["flat", "upright"] = Field(default="flat", description="how the sheet starts: lying or standing")
    height_m: float = Field(
        default=0.0, ge=-100, le=100, description="of a flat sheet, or of the middle of one upright"
    )
    turn_deg: float = Field(default=0.0, ge=-360, le=360, description="turned about the vertical at the start")
    centre_m: tuple[float, float] = Field(default=(0.0, 0.0), description="its middle at the start, x and z [m]")
    friction: float = Field(default=0.3, ge=0, le=5, description="between cloth and [body]")
    gap_mm: float | None = Field(
        default=None, ge=0, le=30, description=f"kept between [body] and the key points [mm]; {AS_DRAWN}"
    )
    pleats: int = Field(default=0, ge=0, le=100, description="an upright sheet starts in so many folds, as a curtain")
    fullness: float = Field(default=2.0, gt=1, le=2.5, description="width of the sheet over that of its pleats")
    roughness_mm: float = Field(
        default=0.0, ge=0, le=100, description="seeded bumps at the start, root mean square [mm]"
    )
    pins: PinsSection = PinsSection()

    @model_validator(mode="after")
    def pleats_stand(self) -> "ClothSection":
        if self.pleats and self.hang != "upright":
            raise ValueError('pleats are of a sheet with hang = "upright"; leave them out, or hang it so')
        return self


class WindSection(Section):
    velocity_m_per_s: Vector
    gusts: float = Field(default=0.0, ge=0, le=10, description="root mean square of gusts over the mean speed")
    period_s: Positive = Field(default=4.0, description="of the slowest gust [s]")
    drag: float = Field(default=1.2, ge=0)
    lift: float = Field(default=0.6, ge=0)
    seed: int = Field(default=0, ge=0, lt=2**31)


class SphereSection(Section):
    centre_m: Vector = (0.0, 0.0, 0.0)
    radius_m: Positive = 0.25
    friction: float = Field(default=0.3, ge=0)
    gap_mm: float | None = Field(
        default=None, ge=0, description=f"kept between its surface and the key points [mm]; {AS_DRAWN}"
    )
    colour: str = Field(default="#b9b4aa", description="of the ball that is drawn")


class PlaneSection(Section):
    height_m: float = 0.0
    friction: float = Field(default=0.3, ge=0)
    gap_mm: float | None = Field(default=None, ge=0, description=f"kept between it and the key points [mm]; {AS_DRAWN}")


class StrainLimitSection(Section):
    percent: float = Field(default=10.0, ge=0, le=100, description="by how much a thread may grow at most [%]")
    passes: int = Field(default=3, ge=1, le=101, description="over threads and seams each substep; more hold closer")


class SelfContactSection(Section):
    thickness_mm: Positive | None = Field(
        default=None,
        description="kept between layers as they are drawn, at most 4 times the spacing of key points [mm]; default: "
        "as thick as the cloth is drawn",
    )
    friction: float | None = Field(default=None, ge=0, le=5, description="default: that of the fabric's yarns")


class ForcesSection(Section):
    """What acts on the sheet from outside; what is left out is not in the kernels either."""

    gravity_m_per_s2: float = Field(default=9.81, ge=0)
    wind: WindSection | None = None
    sphere: SphereSection | None = None
    plane: PlaneSection | None = Field(default=None, description="a level floor")
    strain_limit: StrainLimitSection | None = Field(default=None, description="threads that grow no longer (Provot)")
    self_contact: SelfContactSection | None = Field(
        default=None,
        description="cloth does not pass through cloth; a [cloth], a T-shirt and a skirt have it unless it is false",
    )

    @field_validator("self_contact", mode="before")
    @classmethod
    def may_be_left_out(cls, value: object) -> object:
        return {False: None, True: {}}[value] if isinstance(value, bool) else value


class SolverSection(Section):
    """Who moves the sheet, and by how long steps (docs/solvers.md)."""

    name: Literal["auto", "verlet", "yarns"] = Field(
        default="auto", description="default: verlet or yarns, whichever takes less time for the sheet at equal error"
    )
    step_ms: Positive | None = Field(default=None, description="longest substep; default: what the springs allow [ms]")
    safety: Share = Field(default=0.9, gt=0, description="share of the longest stable step")

    @field_validator("name", mode="before")
    @classmethod
    def implicit_is_gone(cls, name: object) -> object:
        if name == "implicit":
            raise ValueError(
                'there is no "implicit" any more; name "yarns", in which threads of any stiffness cost what soft ones '
                'cost, or "verlet"'
            )
        return name
