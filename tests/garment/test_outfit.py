"""Several garments as one: what is each garment's own, where outer ones start, and what passes through what."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from taichi_cloth.garment.outfit.outfit import Outfit, outfit_of
from taichi_cloth.garment.outfit.over import ROOM, cleared, start_over
from taichi_cloth.garment.outfit.passing import passing
from taichi_cloth.garment.pattern.cut import cut
from taichi_cloth.garment.pattern.drafts import draft
from taichi_cloth.garment.pattern.measure import figure_of
from taichi_cloth.garment.pattern.pattern import Cone, Flat, Hold, Panel, Pattern, Seam, Side, Wrap
from taichi_cloth.garment.sewn.garment import Garment
from taichi_cloth.ground.errors import InputError
from taichi_cloth.scenes.scene.body_section import BodySection, prepare_body
from taichi_cloth.sheet.materials import MATERIALS

SPACING = (0.05, 0.05)


def panel(name: str, wide: float, tall: float, z: float) -> Panel:
    """An upright rectangle in front of the origin."""
    corners = np.array([(0, 0), (wide, 0), (wide, tall), (0, tall), (0, 0)], np.float64) - np.array([wide / 2, 0.0])
    return Panel(name, tuple(corners[k : k + 2] for k in range(4)), Flat(np.eye(3), np.array([0.0, 1.0, z])))


def garment(material: str, wide: float = 0.4, hem: float = 0.0, z: float = 0.1) -> Garment:
    """Two rectangles, sewn along one side, the first held along its top."""
    panels = panel("front", wide, 0.3, z), panel("back", wide, 0.3, -z)
    seams = (Seam(Side("front", 1), Side("back", 1)),)
    pattern = Pattern("sandwich", panels, seams, (Hold(Side("front", 2)),))
    return Garment(pattern, cut(pattern, SPACING), MATERIALS[material], hem)


@cache
def two() -> Outfit:
    return outfit_of(("inner", "outer"), (garment("denim"), garment("silk-habotai", 0.6)))


def test_each_keeps_its_own_cloth() -> None:
    outfit = two()
    assert [p.panel.name for p in outfit.atlas.panels] == ["inner front", "inner back", "outer front", "outer back"]
    sheet, alone = outfit.sheet(), [part.sheet() for part in outfit.parts]
    assert [cloth.material for cloth in sheet.cloths] == [MATERIALS["denim"], MATERIALS["silk-habotai"]]
    for number, one in enumerate(alone):
        np.testing.assert_array_equal(outfit.of(number, sheet.mass), one.mass)
        assert sheet.cloths[number].springs == one.springs
    np.testing.assert_allclose(sheet.mass.sum(), sum(one.mass.sum() for one in alone))
    assert sheet.present.sum() == sum(one.present.sum() for one in alone)
    assert [outfit.wearer(k) for k in range(4)] == [0, 0, 1, 1]


def test_seams_and_holds_are_those_of_each() -> None:
    outfit, parts = two(), two().parts
    assert len(outfit.seams()[0]) == sum(len(part.seams()[0]) for part in parts)
    for number, (part, first) in enumerate(zip(parts, outfit.first_rows, strict=True)):
        begin = sum(len(one.holds()[0]) for one in parts[:number])
        nodes, _, places = (values[begin : begin + len(part.holds()[0])] for values in outfit.holds())
        np.testing.assert_array_equal(nodes - np.array([first, 0]), part.holds()[0])
        np.testing.assert_array_equal(places, part.holds()[2])
    # Each waistband presses on its own, the narrower no less for the other.
    np.testing.assert_array_equal(outfit.borne(0.3), np.concatenate([part.borne(0.3) for part in parts]))
    # Surface and outline are those of all, each corner a blend of its own garment's key points.
    rows = np.repeat(np.arange(outfit.atlas.shape[0]), outfit.atlas.shape[1])
    of_key = np.searchsorted(outfit.first_rows, rows, side="right") - 1
    blend = outfit.outline.blend.tocoo()
    wearer = np.array([outfit.wearer(k) for k in range(4)])
    np.testing.assert_array_equal(of_key[blend.col], wearer[outfit.outline.panel][blend.row])
    assert len(outfit.outline.faces) == sum(len(part.outline.faces) for part in parts)


def test_hems_are_each_ones_own() -> None:
    plain = garment("denim")
    panels = tuple(replace(one, hems=(0,)) for one in plain.pattern.panels)
    pattern = replace(plain.pattern, panels=panels)
    hemmed = Garment(pattern, cut(pattern, SPACING), plain.material, 0.05)
    outfit = outfit_of(("plain", "hemmed"), (plain, hemmed))
    assert outfit.of(0, np.pad(outfit.layers, ((0, 1), (0, 1)))).max() <= 1.0
    assert outfit.sheet().mass.sum() == pytest.approx(plain.sheet().mass.sum() + hemmed.sheet().mass.sum())


def test_what_cannot_be_one_is_refused() -> None:
    one = garment("denim")
    with pytest.raises(InputError, match="two garments called 'a'"):
        outfit_of(("a", "a"), (one, one))
    finer = Garment(one.pattern, cut(one.pattern, (0.03, 0.03)), one.material)
    with pytest.raises(InputError, match="not equally far apart"):
        outfit_of(("a", "b"), (one, finer))


def test_planes_start_before_what_is_worn_and_rings_round_it() -> None:
    random = np.random.Generator(np.random.Philox(key=2))
    points = random.uniform((-0.1, 1.1, -0.15), (0.1, 1.2, 0.15), (200, 3))
    front = cleared(panel("front", 0.4, 0.3, 0.1), points)
    assert front.world[:, 2].min() >= points[:, 2].max() + 0.99 * ROOM
    far = cleared(panel("front", 0.4, 0.3, 0.3), points)
    np.testing.assert_array_equal(far.world, panel("front", 0.4, 0.3, 0.3).world)  # is clear as it is
    beside = cleared(panel("front", 0.4, 0.3, 0.1), points + np.array([1.0, 0.0, 0.0]))
    np.testing.assert_array_equal(beside.world, panel("front", 0.4, 0.3, 0.1).world)
    up, ahead, edges = np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0]), panel("", 0.4, 0.3, 0.0).edges
    for place in (
        Wrap(np.array([0.0, 1.0, 0.0]), up, ahead, (0.12, 0.12)),
        Cone(np.array([0.0, 1.2, 0.0]), ahead, (0.12, 0.12), inner=0.3, angle=1.0),
    ):
        own = edges if isinstance(place, Wrap) else tuple(edge - np.array([0.0, 0.3]) for edge in edges)
        grown = cleared(Panel("ring", own, place), points)
        radius = grown.place.radius  # pyright: ignore[reportAttributeAccessIssue]
        assert np.min(radius) >= np.hypot(points[:, 0], points[:, 2]).max()


def test_an_outer_garment_starts_clear_of_what_is_worn() -> None:
    """A T-shirt over trousers as deep as they start, whose seat reaches beyond its back as drafted, and as narrow
    as they are worn: what is drawn of its open side seams goes from front to back."""
    body = prepare_body(BodySection(gender="male"))
    patterns = [draft(name, figure_of(body)) for name in ("trousers", "tshirt")]
    parts = [Garment(one, cut(one, SPACING), MATERIALS["denim"]) for one in patterns]
    outfit = outfit_of(("trousers", "tshirt"), parts)
    narrow = np.array([0.7, 1.0, 1.0])
    inner = parts[0].atlas.start() * narrow
    start = start_over(outfit, inner)
    np.testing.assert_array_equal(outfit.of(0, start), inner)
    assert passing(outfit, start) is None
    as_drafted = outfit.atlas.start()
    outfit.of(0, as_drafted)[:] = inner
    assert "tshirt passes through trousers" in str(passing(outfit, as_drafted))
