"""What a scene is: every section, key, unit and allowed value. A scene that validates can be built.

A scene builds the last thing it names: `[fibre]` alone gives one fibre, with `[yarn]` a length of yarn, with
`[twist]` a yarn being twisted, with `[weave]` a fabric, with `[cloth]` one that moves. What it does not name is not
built.
"""

from functools import cached_property
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, ValidationError, field_validator, model_validator

from taichi_cloth.fabric.pose import Bent, Pose
from taichi_cloth.ground.errors import InputError
from taichi_cloth.yarn.count import parse_count
from taichi_cloth.yarn.yarn import Direction

from .body_section import BodySection
from .cloth_schema import ClothSection, ForcesSection, SolverSection
from .garment_schema import CLEAR, GarmentSection
from .picture_schema import Camera, Light, Output, StageSection
from .section import DRAFT_FILE, SPRITE_FILE, Positive, Section, Share

__all__ = [
    "OWN",
    "WOVEN",
    "Camera",
    "FabricSection",
    "Fibre",
    "HairinessSection",
    "Light",
    "Output",
    "Scene",
    "StageSection",
    "Subject",
    "Twist",
    "Weave",
    "WornSection",
    "YarnSection",
]

WOVEN = "woven"
"""The material of a cloth whose properties follow from its yarns and weave."""

Subject = Literal["fibre", "yarn", "twist", "fabric", "cloth", "garment", "outfit"]


class Fibre(Section):
    """One fibre: a kind that textile people know, or a sphere set of one's own (paper 2.1)."""

    kind: str = Field(default="cotton", description="cotton, wool, silk, viscose or polyester")
    spheres: list[tuple[float, float, float, float]] | None = Field(
        default=None, description="own contour: rows [x, y, z, radius] in µm, the fibre's axis along x"
    )
    fineness_dtex: Positive | None = Field(
        default=None, description="linear density of one fibre [dtex]; default: what is usual of its kind"
    )
    blend: dict[str, Positive] = Field(
        default={}, description="shares of the mass of what it is spun of, such as {cotton = 65, polyester = 35}"
    )
    modulus_n_per_tex: Positive | None = Field(default=None, description="of the fibre in tension [N/tex]")
    flexural_mn_mm2_per_tex2: Positive | None = Field(
        default=None, description="specific flexural rigidity of the fibre [mN·mm²/tex²]; default: that of its kind"
    )
    friction: Positive | None = Field(default=None, description="of its yarns on one another; default: its kind's")
    length_um: float = Field(default=240.0, gt=0, le=1e5, description="length of the fibre shown [µm]")
    spacing_um: float = Field(default=0.7, gt=0, description="distance between lattice particles [µm]")
    jitter: float = Field(default=0.3, ge=0, le=1, description="largest perturbation, in fractions of the spacing")
    particle_size: float = Field(default=0.8, gt=0, le=5, description="particle radius, in fractions of the spacing")
    sprite: Annotated[Literal["thread", "round", "soft", "fuzzy"] | str, SPRITE_FILE] = Field(
        default="thread", description="alpha texture of a particle: a name, or a PNG with alpha"
    )
    colour: str | None = Field(default=None, description="instead of the kind's own colour: a name or #rrggbb")


class HairinessSection(Section):
    ends_per_m: float = Field(default=0.0, ge=0, le=1e5, description="flyaway fibre ends per metre of yarn")
    loops_per_m: float = Field(default=0.0, ge=0, le=1e5, description="fibre loops per metre of yarn")
    height_mm: float = Field(default=0.4, gt=0, le=20, description="mean rise above the yarn's surface [mm]")
    lie: float = Field(default=1.5, ge=0.1, le=50, description="how far a hair goes along its yarn over its rise")


class YarnSection(Section):
    """A yarn as a spinner states it (paper 2.2)."""

    count_tex: Positive | None = Field(
        default=None,
        description="linear density of one single [tex]; default: what the draft's spacing asks for, else 20",
    )
    count_ne: Positive | None = Field(default=None, description="the same as an English cotton count [Ne]")
    count: str | None = Field(
        default=None, description='that and the plies as the trade writes it: "30/2", "2/60 Nm", "20 den", "tex 20x2"'
    )
    plies: int = Field(default=2, ge=1, le=12, description="singles folded together; default: 2, or what count says")
    twist_per_m: float = Field(
        default=700.0, ge=0, description="folding twist [turns/m]; the yarn's own when plies = 1"
    )
    twist_multiplier: Positive | None = Field(
        default=None, description="the same by the cotton count: turns an inch over √Ne, of the whole yarn"
    )
    twist: Direction = "S"
    singles_twist_per_m: float = Field(default=0.0, ge=0, description="twist left in each single [turns/m]")
    singles_twist: Direction = "Z"
    packing: float = Field(default=0.60, ge=0.05, le=0.95, description="share of a single's section that is fibre")
    flattening: float = Field(default=1.5, ge=0.5, le=3, description="section of a ply, tangential over radial axis")
    migration: Share = Field(default=0.25, description="how far a fibre wanders in the section")
    migration_period_mm: Positive = Field(default=4.0, description="over which length it wanders [mm]")
    hairiness: HairinessSection | None = Field(
        default=None, description="fibres that leave the yarn; default: as is usual of its fibre and count"
    )
    unevenness: float | None = Field(
        default=None,
        ge=0,
        le=0.5,
        description="coefficient of variation of its mass along it; default: as is usual of its fibre and count",
    )
    colour: str | None = Field(default=None, description="a name or #rrggbb; default: the fibre's own")
    fibres: int | None = Field(
        default=None,
        ge=1,
        le=2000,
        description="fibres drawn a ply, at most as many as it has; default: as many as a picture tells apart",
    )
    length_mm: float = Field(default=6.0, gt=0, le=1e5, description="length shown when the scene is of a yarn [mm]")
    construction: Literal["fibres", "lattice"] = Field(
        default="fibres",
        description='"lattice" fills the singles with the particles of a sphere set, as the paper does',
    )

    @field_validator("count")
    @classmethod
    def count_is_known(cls, count: str | None) -> str | None:
        if count is not None:
            try:
                parse_count(count)
            except InputError as error:
                raise ValueError(str(error).removeprefix("yarn.count: ")) from None
        return count

    @property
    def counted(self) -> bool:
        """Whether a count is stated."""
        return any(value is not None for value in (self.count, self.count_tex, self.count_ne))

    @model_validator(mode="after")
    def one_count(self) -> "YarnSection":
        given = [key for key in ("count", "count_tex", "count_ne") if getattr(self, key) is not None]
        if len(given) > 1:
            raise ValueError(f"{given[0]} and {given[1]} are two names for one thing; give one of them")
        plies = parse_count(self.count).plies if self.count is not None else self.plies
        if "plies" in self.model_fields_set and plies != self.plies:
            raise ValueError(f"count {self.count!r} has plies of {plies}, plies is {self.plies}; leave one out")
        if self.twist_multiplier is not None and "twist_per_m" in self.model_fields_set:
            raise ValueError("twist_per_m and twist_multiplier are two names for one thing; give one of them")
        return self


class WeavePatch(Section):
    """Another draft on a part of a cloth."""

    draft: Annotated[str, DRAFT_FILE] = Field(description="a weave or the path of a .wif file")
    end: int = Field(ge=0, description="its first warp end, from the left")
    pick: int = Field(ge=0, description="its first weft pick, from the bottom")
    ends: int = Field(ge=1, description="how many warp ends it takes")
    picks: int = Field(ge=1, description="how many weft picks it takes")


class Weave(Section):
    """Which yarn is on top (paper 2.3): a named weave or a WIF file, and the threads' colours."""

    draft: Annotated[str, DRAFT_FILE] = Field(
        default="plain", description="plain, twill-2/2, satin-5, … or the path of a .wif file"
    )
    ends: int | None = Field(default=None, description="warp ends; default: 40; of a file whole repeats, 24 or more")
    picks: int | None = Field(default=None, description="weft picks; default: likewise")
    warp_colours: str | None = Field(default=None, description='thread order, such as "navy*4 white*4"')
    weft_colours: str | None = None
    patches: list[WeavePatch] = Field(default=[], description="other drafts on parts of the cloth, later ones on top")


class FabricSection(Section):
    """Spacing of the threads, how finely they are drawn, and how the cloth lies."""

    ends_per_cm: Positive | None = Field(
        default=None,
        description="warp ends per cm; default: the file's, or what fits; of what moves, what key points make",
    )
    picks_per_cm: Positive | None = Field(default=None, description="weft picks per cm; likewise")
    balance: float = Field(default=0.5, ge=0.05, le=0.95, description="the warp's part of the crimp height")
    flattening: float = Field(default=2.0, ge=1, le=6, description="width of a thread over its thickness where it lies")
    finish: str = Field(default="plain", description="plain, softened, raised, resin, sized or starched")
    when_jammed: Literal["scale", "refuse"] = Field(
        default="scale", description="threads too thick for their spacing: thin them with a note, or refuse"
    )
    steps: int = Field(
        default=10, ge=1, le=200, description="particles along a fibre between two crossings, fewer from far away"
    )
    variants: int = Field(default=8, ge=1, le=256, description="fillings of each kind of block")
    fringe: float = Field(default=1.5, ge=0, le=20, description="free yarn beyond the last crossing [thread spacings]")
    irregularity: float = Field(default=0.03, ge=0, le=0.3, description="how far threads stray, in thread spacings")
    pose: Pose = "flat"
    pose_amount: float = Field(default=1.0, ge=0, le=10, description="how strongly it is folded or rolled")
    bent: Bent = Field(default="weft", description="which threads the folds or the roll bend")


class Twist(Section):
    """A yarn fed at A, twisted at B and taken up at C (paper 2.2.3)."""

    zone_a_mm: float = Field(default=10.0, gt=0, description="distance from A to B [mm]")
    zone_b_mm: float = Field(default=10.0, gt=0, description="distance from B to C [mm]")
    speed_mm_per_s: float = Field(default=8.0, ge=0, description="speed of the yarn V [mm/s]")
    turns_per_s: float = Field(default=6.0, ge=-1e5, le=1e5, description="speed of the twister at B [turns/s]")
    duration_s: float = Field(default=3.0, gt=0, le=1e4, description="time shown [s]")
    feed_mm: float = Field(default=2.0, ge=0, description="yarn shown before A and after C [mm]")
    colours: tuple[str, str] = ("#c8102e", "#12863a")


class WornSection(GarmentSection):
    """A garment of an outfit, and the cloth that it is cut from."""

    name: str | None = Field(default=None, description="what it is called; default: its pattern's name")
    fibre: Fibre = Fibre()
    yarn: YarnSection | None = None
    weft_yarn: YarnSection | None = None
    weave: Weave | None = None
    fabric: FabricSection | None = None

    @property
    def called(self) -> str:
        return self.name or Path(self.pattern).stem


OWN = ("fibre", "yarn", "weft_yarn", "weave", "fabric")
"""Sections that each garment of an outfit has for itself."""
MOST_WORN = 8
ALIKE = ("gap_mm", "follow", "representation")
"""Keys that all garments of an outfit share."""


def _pattern(garment: object) -> object:
    """Of a [garment], as it is stated or by default; None where there is none."""
    if isinstance(garment, dict):
        return garment.get("pattern", GarmentSection().pattern)
    return garment.pattern if isinstance(garment, GarmentSection) else None


class Scene(Section):
    """A whole scene. `subject` is what it shows: the last thing it names."""

    title: str = ""
    seed: int = Field(default=0, ge=0, lt=2**31)
    fibre: Fibre = Fibre()
    yarn: YarnSection | None = None
    weft_yarn: YarnSection | None = Field(default=None, description="where the weft differs from [yarn]")
    twist: Twist | None = None
    weave: Weave | None = None
    fabric: FabricSection | None = None
    cloth: ClothSection | None = None
    garment: GarmentSection | None = None
    outfit: tuple[WornSection, ...] = Field(
        default=(), description="several garments, in the order worn, the innermost first; in TOML [[garment]]"
    )
    body: BodySection | None = None
    forces: ForcesSection | None = None
    solver: SolverSection | None = None
    camera: Camera = Camera()
    light: Light = Light()
    stage: StageSection = StageSection()
    output: Output = Output()

    @model_validator(mode="before")
    @classmethod
    def layers_meet(cls, data: object) -> object:
        """A [cloth] that says nothing of `forces.self_contact` has it; an outfit and a [garment] of CLEAR, too."""
        if not isinstance(data, dict):
            return data
        if data.get("cloth") is None and not data.get("outfit") and _pattern(data.get("garment")) not in CLEAR:
            return data
        forces = data.get("forces")
        if forces is None or (isinstance(forces, dict) and "self_contact" not in forces):
            return {**data, "forces": {**(forces or {}), "self_contact": {}}}
        return data

    @model_validator(mode="after")
    def sections_agree(self) -> "Scene":
        if self.weave and self.twist:
            raise ValueError("a scene shows either [weave] or [twist], not both; leave one of them out")
        if self.fabric and not self.weave:
            raise ValueError('[fabric] needs [weave]; add it, for instance weave.draft = "plain"')
        if (self.twist or self.weave or self.weft_yarn) and not self.yarn:
            raise ValueError("[twist] and [weave] are made of [yarn]; add it, for instance yarn.count_tex = 20")
        return self

    @model_validator(mode="after")
    def cloth_is_whole(self) -> "Scene":
        if (self.forces or self.solver) and not (self.cloth or self.garment or self.outfit):
            raise ValueError("[forces] and [solver] move a [cloth]; add it, for instance cloth.width_m = 1")
        if self.cloth and self.twist:
            raise ValueError("a scene shows either [cloth] or [twist], not both; leave one of them out")
        if self.cloth and self.cloth.representation == "fibre" and not self.weave:
            raise ValueError('cloth.representation "fibre" needs [yarn] and [weave]; add them, or take "mesh"')
        if self.cloth and self.weave and (self.weave.ends or self.weave.picks):
            raise ValueError(
                "weave.ends, weave.picks: a [cloth] has as many as its size and fabric.ends_per_cm, picks_per_cm make; "
                "say these"
            )
        return self

    @model_validator(mode="after")
    def body_has_cloth(self) -> "Scene":
        if self.body and not (self.cloth or self.garment or self.outfit):
            raise ValueError("a [body] wears a [garment] or has a [cloth] fall on it; add one of them")
        if self.cloth and self.cloth.pins.body and not self.body:
            raise ValueError("cloth.pins.body attaches key points to a [body]; add it")
        return self

    @model_validator(mode="after")
    def garment_is_whole(self) -> "Scene":
        if not self.garment:
            return self
        if self.cloth or self.twist:
            raise ValueError("a scene shows one of [garment], [cloth] and [twist]; leave the others out")
        if self.garment.representation == "fibre" and not self.weave:
            raise ValueError('garment.representation "fibre" needs [yarn] and [weave]; add them, or take "mesh"')
        if self.weave and self.weave.patches:
            raise ValueError("weave.patches: a [garment] has drafts by panel; say garment.weaves instead")
        if self.weave and (self.weave.ends or self.weave.picks):
            raise ValueError(
                "weave.ends, weave.picks: a [garment] has as many as its pattern and fabric.ends_per_cm, picks_per_cm "
                "make; say these"
            )
        return self

    @model_validator(mode="after")
    def outfit_is_whole(self) -> "Scene":
        if not self.outfit:
            return self
        if self.garment or self.cloth or self.twist:
            raise ValueError("a scene shows one of [garment], [[garment]], [cloth] and [twist]; leave the others out")
        for key in OWN:
            if key in self.model_fields_set:
                raise ValueError(
                    f"[{key}]: each garment of an outfit has its own; write it as [garment.{key}] below it"
                )
        if not 2 <= len(self.outfit) <= MOST_WORN:
            raise ValueError(f"{len(self.outfit)} [[garment]]; allowed: 2 to {MOST_WORN}, or one [garment]")
        names = [worn.called for worn in self.outfit]
        for name in names:
            if name in WornSection.model_fields or not name.replace("-", "_").isidentifier():
                raise ValueError(f"garment.name: {name!r}; allowed: a word that is no key of a garment, such as shirt")
            if names.count(name) > 1:
                raise ValueError(f"two garments called {name!r}; give each a garment.name of its own")
        for key in ALIKE:
            if len({getattr(worn, key) for worn in self.outfit}) > 1:
                raise ValueError(f"garment.{key}: garments of an outfit share one; state the same for all, or for none")
        if self.forces is not None and self.forces.self_contact is None:
            raise ValueError("forces.self_contact: garments of an outfit touch by it; leave it out")
        assert self.garments
        return self

    @cached_property
    def garments(self) -> tuple["Scene", ...]:
        """The garments of an outfit, each as a scene of its own on the same body. Raises ValueError on what is none."""
        shared = {key: getattr(self, key) for key in self.model_fields_set - {"outfit", "title"}}
        out = []
        for worn in self.outfit:
            stated = worn.model_fields_set
            own = {key: getattr(worn, key) for key in OWN if key in stated}
            section = {key: getattr(worn, key) for key in GarmentSection.model_fields if key in stated}
            try:
                out.append(Scene(title=worn.called, garment=GarmentSection(**section), **own, **shared))
            except ValidationError as error:
                raise ValueError(f"{worn.called}: {error.errors()[0].get('ctx', {}).get('error', error)}") from None
        return tuple(out)

    @property
    def material(self) -> str:
        """Of what moves: as stated, or what [yarn], [weave] and a sett make."""
        section = self.cloth or self.garment
        if section is not None and section.material is not None:
            return section.material
        sett = self.fabric is not None and None not in (self.fabric.ends_per_cm, self.fabric.picks_per_cm)
        return WOVEN if self.weave is not None and self.yarn is not None and sett else "cotton-shirting"

    @property
    def is_worn(self) -> bool:
        """Whether it is of a garment, or of several."""
        return bool(self.garment or self.outfit)

    @property
    def is_soft(self) -> bool:
        """Whether its subject is cloth that moves as one: a sheet, or what is worn."""
        return bool(self.cloth) or self.is_worn

    @property
    def subject(self) -> Subject:
        if self.outfit:
            return "outfit"
        if self.garment:
            return "garment"
        if self.cloth:
            return "cloth"
        if self.weave:
            return "fabric"
        if self.twist:
            return "twist"
        return "yarn" if self.yarn else "fibre"
