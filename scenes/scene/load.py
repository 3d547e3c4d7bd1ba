"""Scenes from TOML: found, read, overridden, and checked before anything is built."""

import os
import re
import tomllib
from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, Union, get_args, get_origin

from pydantic import BaseModel, ValidationError

from taichi_cloth.ground.errors import InputError, did_you_mean
from taichi_cloth.ground.files import read_text, shown_path
from taichi_cloth.weave.colour_order import colour

from ...render.data.finish import finish_for
from .constructions import give_way, is_stated, with_construction, woven_where_changed
from .draft_file import draft_file
from .outfit_data import apart, is_outfit, name_of, overrides_of, together, worn_over
from .scene_files import files_named
from .schema import Scene
from .section import DRAFT_FILE, SPRITE_FILE

__all__ = ["built_in_scenes", "load_scene", "make_scene"]

TRADE_WORDS = {
    **dict.fromkeys(("epi", "ends_per_inch"), "fabric.ends_per_cm, ends an inch / 2.54"),
    **dict.fromkeys(("ppi", "picks_per_inch"), "fabric.picks_per_cm, picks an inch / 2.54"),
    **dict.fromkeys(("epc", "ends_per_cm", "ends", "sett", "warp_sett"), "fabric.ends_per_cm"),
    **dict.fromkeys(("ppc", "picks_per_cm", "weft_sett"), "fabric.picks_per_cm"),
    **dict.fromkeys(("ne", "tex", "nm", "den", "denier", "yarn_count"), "yarn.count, such as Ne 30 or 2/60 Nm"),
    **dict.fromkeys(("ply", "plied"), "yarn.plies"),
    **dict.fromkeys(("tpi", "tpm", "turns_per_m"), "yarn.twist_per_m, turns a metre"),
    **dict.fromkeys(("tm", "alpha"), "yarn.twist_multiplier"),
    **dict.fromkeys(("gsm", "weight", "density"), "properties.density_g_per_m2, of the [cloth] or [garment]"),
    **dict.fromkeys(("weave", "pattern", "draft", "wif"), "weave.draft"),
    **dict.fromkeys(("micron", "denier_per_filament", "dpf", "fineness"), "fibre.fineness_dtex"),
}
"""What people call a key: where it stands here."""
PICTURE_WORDS = {
    **dict.fromkeys(("width", "height", "resolution", "size", "pixels"), "output.size, or --size WIDTHxHEIGHT"),
    **dict.fromkeys(("views", "angles"), "output.views, or --views"),
    **dict.fromkeys(("frames", "duration", "length"), "output.frames, or --frames"),
}
"""The same of the sections that say how a picture is taken."""
TAKES_PICTURES = ("camera", "light", "stage", "output")
LARGEST_SCENE_FILE = 1_000_000
LONGEST_LIST = 50_000
"""Values: what is wrong with each would be a line of its own."""
DEEPEST_KEY = 8
LONG_KEY = re.compile(r"""(?<![\w.'"-])(?:(?:[\w-]++|"(?:[^"\\\n]|\\.)*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+){32}""")
"""A dotted key of more than 32 parts, bare or quoted."""
SPRITES = ("thread", "round", "soft", "fuzzy")


def built_in_scenes() -> dict[str, str]:
    """Names of the built-in scenes and their titles, a line each."""
    return {name: tomllib.loads(_built_in(name)).get("title", "") for name in _names_built_in()}


def load_scene(name: str, overrides: list[str] | None = None) -> Scene:
    """A built-in scene by name or a TOML file by path, with `key=value` overrides as on the command line.

    A WIF file brings its own size, colours, spacing and thickness: when `weave.draft` is overridden with one, what
    the scene says of these for its own draft is dropped; further overrides still hold. Colours of a family for which
    the file has none stay the scene's, and a cloth or garment with a sett keeps it, and its yarns, where the file
    states none. Likewise a cloth or garment whose sett is overridden is woven, and no longer of the scene's material;
    one whose material is overridden has that material's construction, and is woven where further overrides change it.
    Raises InputError, one line: which file, key and value, what is allowed, and the nearest right spelling.

    >>> load_scene("swatch", ["weave.draft=satin-5", "output.views=4"]).output.views
    4
    """
    data, where, folder = _read(name)
    if is_outfit(data):
        return make_scene(_outfit(data, where, folder, overrides or []), where)
    given = {key.strip(): value.strip() for key, _, value in (text.partition("=") for text in overrides or [])}
    taken_up = give_way(data, given)
    for text in overrides or []:
        _override(data, text)
    if taken_up:
        data = woven_where_changed(data)
    _placed(data, folder, given)
    return make_scene(data, where)


def _placed(data: dict[str, Any], folder: Path | None, given: Mapping[str, str]) -> None:
    """A path in a file is meant from where the file lies; not one that an override states."""
    for name, table, key in files_named(data) if folder else ():
        if not is_stated(given, name):
            table[key] = str(folder / table[key])


def _outfit(data: dict[str, Any], where: str, folder: Path | None, overrides: list[str]) -> dict[str, Any]:
    """The data of an outfit: each garment as if it were a scene of its own, with overrides of all or of itself."""
    alone = []
    for number, said in enumerate(data.pop("garment")):
        made, source, its_folder = {}, None, folder
        if isinstance(said, dict) and "scene" in said:
            source = said["scene"]
            if not isinstance(source, str):
                raise InputError(
                    f"{where}: garment {number + 1}: scene: {_short(source)}; allowed: a scene of a [garment]"
                )
            path = source if folder is None or not source.endswith(".toml") else str(folder / source)
            made, _, its_folder = _read(path)
            if not isinstance(made.get("garment"), dict):
                raise InputError(f"{where}: garment {number + 1}: scene: {source!r} has no [garment]")
            _placed(made, its_folder, {})
        own = apart(said, number, where)
        _placed(own, folder, {})
        alone.append(worn_over(made, own, source))
    names = [name_of(one) for one in alone]
    _placed(data, folder, {text.partition("=")[0].strip(): "" for text in overrides})
    for one, name in zip(alone, names, strict=True):
        mine = overrides_of(overrides, name, names)
        given = {key.strip(): value.strip() for key, _, value in (text.partition("=") for text in mine)}
        taken_up = give_way(one, given)
        for text in mine:
            _override(one, text)
        if taken_up:
            one.update(woven_where_changed(one))
    for text in overrides:
        if not text.strip().startswith("garment."):
            _override(data, text)
    return {**data, "outfit": [together(with_construction(one)) for one in alone]}


def make_scene(data: dict[str, Any], where: str = "scene") -> Scene:
    """Check a scene given as nested dictionaries. Raises InputError; `where` names its source in the line."""
    if is_outfit(data):
        data = _outfit(dict(data), where, None, [])
    if _longest(data) > LONGEST_LIST:
        raise InputError(f"{where}: a list of {_longest(data):,} values; allowed: up to {LONGEST_LIST:,}")
    try:
        scene = Scene.model_validate(with_construction(data))
        _check_names(scene)
    except ValidationError as error:
        raise InputError(f"{where}: {_line(error)}") from None
    except InputError as error:
        raise InputError(f"{where}: {error}") from None
    return scene


def _longest(data: Any) -> int:
    """How many values the longest list has."""
    inner = data.values() if isinstance(data, dict) else data if isinstance(data, list) else ()
    return max(len(data) if isinstance(data, list) else 0, *map(_longest, inner), 0)


def _check_names(scene: Scene) -> None:
    """Look up what the schema leaves as text, so that a misspelling shows before anything is built."""
    for one in scene.garments:
        try:
            _check_names(one)
        except InputError as error:
            raise InputError(f"{one.title}: {error}") from None
    yarn, weft, twist = scene.yarn, scene.weft_yarn, scene.twist
    named = [("fibre.colour", scene.fibre.colour)]
    named += [("yarn.colour", yarn.colour if yarn else None), ("weft_yarn.colour", weft.colour if weft else None)]
    named += [("twist.colours", name) for name in (twist.colours if twist else ())]
    named += [("light.background", name) for name in scene.light.background]
    for key, name in named:
        if name is not None:
            try:
                colour(name)
            except InputError as error:
                raise InputError(f"{key}: {error}") from None
    if scene.light.finish is not None:
        try:
            finish_for(scene.light.finish)
        except InputError as error:
            raise InputError(f"light.{error}") from None
    for name, table, key in files_named(scene.model_dump(mode="json")):
        if DRAFT_FILE.fits(table[key]):
            try:
                draft_file(table[key])
            except InputError as error:
                raise InputError(f"{name}: {error}") from None
    sprite = scene.fibre.sprite
    if sprite not in SPRITES:
        if not SPRITE_FILE.fits(sprite):
            raise InputError(
                f"fibre.sprite: unknown sprite {sprite!r}; known: {', '.join(SPRITES)}, or the path of a .png file "
                f"with alpha{did_you_mean(sprite, SPRITES)}"
            )
        from ...render.data.sprites import sheet_from_png  # loads OpenCV, which nothing else here needs

        try:
            sheet_from_png([sprite])
        except (InputError, ValueError) as error:
            raise InputError(f"fibre.sprite: {error}") from None


def _names_built_in() -> list[str]:
    entries = [entry.name for entry in files("taichi_cloth.scenes").iterdir()]
    return sorted(name.removesuffix(".toml") for name in entries if name.endswith(".toml"))


def _built_in(name: str) -> str:
    return (files("taichi_cloth.scenes") / f"{name}.toml").read_text("utf-8")


def _read(name: str) -> tuple[dict[str, Any], str, Path | None]:
    known = _names_built_in()
    if name in known:
        return tomllib.loads(_built_in(name)), name, None
    path = Path(name)
    if DRAFT_FILE.fits(name):  # a draft is a scene of its own cloth
        draft_file(name)
        return {"title": path.stem, "yarn": {"plies": 1}, "weave": {"draft": name}}, shown_path(name), None
    looks_like_path = path.suffix == ".toml" or "/" in name or "\\" in name
    if not looks_like_path and not os.path.isfile(name):
        raise InputError(
            f"scene: unknown scene {_short(name)}; known: {', '.join(known)}, or the path of a .toml file"
            f"{did_you_mean(name[:100], known)}"
        )
    text = read_text(path, most=LARGEST_SCENE_FILE, give="a built-in scene or a .toml file")
    try:
        return _toml(text), shown_path(name), path.resolve().parent
    except RecursionError:
        raise InputError(f"{shown_path(name)}: not a scene: nested too deeply") from None
    except ValueError as error:  # TOMLDecodeError, or an integer with more digits than Python reads
        raise InputError(f"{shown_path(name)}: not TOML: {error}") from None


def _toml(text: str) -> dict[str, Any]:
    """What TOML says. Raises ValueError for a key of far too many parts: tomllib's memory goes with their square."""
    deep = LONG_KEY.search(text)
    if deep is not None:
        line = text.count("\n", 0, deep.start()) + 1
        raise ValueError(f"line {line}: a key of more than 32 parts, {deep[0][:40]}…")
    return tomllib.loads(text)


def _override(data: dict[str, Any], text: str) -> None:
    key, sign, value = text.partition("=")
    parts = key.strip().split(".")
    if not sign or not all(parts):
        raise InputError(f"--set {text[:200]}: expected key=value, for instance weave.draft=twill-2/2")
    if len(parts) > DEEPEST_KEY:
        raise InputError(
            f"--set {text[:60]}…: a key has at most {DEEPEST_KEY} parts, such as yarn.hairiness.ends_per_m"
        )
    at = data
    for part in parts[:-1]:
        at = at.setdefault(part, {})
        if not isinstance(at, dict):
            raise InputError(f"--set {text[:200]}: {part} is a value, not a section")
    at[parts[-1]] = _value(value.strip())


def _value(text: str) -> Any:
    """A TOML value where it reads as one (3, true, [1, 2], "a"); anything else is text as it stands."""
    try:
        return _toml(f"x = {text}")["x"]
    except (ValueError, RecursionError):
        return text


def _line(error: ValidationError) -> str:
    """The first thing wrong, as one line; how many more there are."""
    problems = error.errors(include_url=False)
    first = problems[0]
    path = [part for part in first["loc"] if not (isinstance(part, str) and part.startswith("function-"))]
    key = ".".join(str(part) for part in path) or "scene"
    if path[:1] == ["outfit"] and len(path) > 1:
        key = ": ".join(filter(None, [f"garment {int(path[1]) + 1}", ".".join(str(part) for part in path[2:])]))
    if first["type"] == "extra_forbidden":
        allowed = _keys_at(path[:-1])
        said = str(path[-1])[:100]
        words = PICTURE_WORDS if path[0] in TAKES_PICTURES else TRADE_WORDS
        named = words.get(said.lower(), "")
        hint = f" (did you mean {named}?)" if named else did_you_mean(said, allowed)
        line = f"{key[:200]}: unknown key; known: {', '.join(allowed)}{hint}"
    elif first["type"] == "value_error":
        prefix = "" if key == "scene" else f"{key}: "
        line = prefix + str(first.get("ctx", {}).get("error", first["msg"]))
    elif first["type"] == "missing":
        line = f"{key}: is missing"
    elif first["type"] in ("model_type", "model_attributes_type", "dict_type"):
        line = f"{key}: {_short(first.get('input'))}; allowed: a section, with {', '.join(_keys_at(path)) or 'keys'}"
    else:
        given = first.get("input")
        shown = _short(given)
        message = first["msg"].removeprefix("Input should be ")
        hint = ""
        if first["type"] == "literal_error" and isinstance(given, str):
            choices = str(first.get("ctx", {}).get("expected", "")).replace("'", "").replace(" or ", ", ").split(", ")
            hint = did_you_mean(given, choices)
        line = f"{key}: {shown}; allowed: {message}{hint}"
    more = len(problems) - 1
    return line + (f" (and {more} more to mend after this)" if more else "")


def _short(value: Any) -> str:
    """The value as Python writes it, cut where it gets long."""
    try:
        text = repr(value)
    except (RecursionError, ValueError):  # nested too deeply, or an integer of thousands of digits
        return f"a {type(value).__name__}"
    return text if len(text) < 60 else text[:57] + "…"


def _keys_at(path: list[Any]) -> list[str]:
    """The keys that a section allows."""
    model: Any = Scene
    for part in path:
        if isinstance(part, int):
            continue
        if not (isinstance(model, type) and issubclass(model, BaseModel)) or part not in model.model_fields:
            return []
        model = _section_of(model.model_fields[part].annotation)
    return list(model.model_fields) if isinstance(model, type) and issubclass(model, BaseModel) else []


def _section_of(annotation: Any) -> Any:
    if get_origin(annotation) in (Union, UnionType):
        return next((a for a in get_args(annotation) if a is not NoneType), annotation)
    if get_origin(annotation) is tuple:
        return get_args(annotation)[0]
    return annotation
