"""Scenes from TOML: found, read, overridden, and checked before anything is built."""

import tomllib
from importlib.resources import files
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, Union, get_args, get_origin

from pydantic import BaseModel, ValidationError

from taichi_cloth.errors import InputError, did_you_mean

from .schema import Scene

__all__ = ["built_in_scenes", "load_scene", "make_scene"]

WIF_BRINGS = {
    "weave": ("ends", "picks", "warp_colours", "weft_colours"),
    "fabric": ("ends_per_cm", "picks_per_cm", "balance"),
}
LARGEST_SCENE_FILE = 4_000_000


def built_in_scenes() -> dict[str, str]:
    """Names of the built-in scenes and their titles, a line each."""
    found = {}
    for entry in files(__package__).iterdir():
        if entry.name.endswith(".toml"):
            found[entry.name.removesuffix(".toml")] = tomllib.loads(entry.read_text("utf-8")).get("title", "")
    return dict(sorted(found.items()))


def load_scene(name: str, overrides: list[str] | None = None) -> Scene:
    """A built-in scene by name or a TOML file by path, with `key=value` overrides as on the command line.

    A WIF file brings its own size, colours and spacing: when `weave.draft` is overridden with one, what the scene
    says of these for its own draft is dropped; further overrides still hold.
    Raises InputError, one line: which file, key and value, what is allowed, and the nearest right spelling.
    """
    data, where, folder = _read(name)
    given = {key.strip(): value.strip() for key, _, value in (text.partition("=") for text in overrides or [])}
    if given.get("weave.draft", "").strip("\"'").lower().endswith(".wif"):
        for section, keys in WIF_BRINGS.items():
            for key in keys:
                data.get(section, {}).pop(key, None)
    for text in overrides or []:
        _override(data, text)
    draft = data.get("weave", {}).get("draft") if isinstance(data.get("weave"), dict) else None
    if folder and isinstance(draft, str) and draft.lower().endswith(".wif") and "weave.draft" not in given:
        data["weave"]["draft"] = str(folder / draft)  # a path in a file is meant from where the file lies
    return make_scene(data, where)


def make_scene(data: dict[str, Any], where: str = "scene") -> Scene:
    """Check a scene given as nested dictionaries. Raises InputError; `where` names its source in the line."""
    try:
        return Scene.model_validate(data)
    except ValidationError as error:
        raise InputError(f"{where}: {_line(error, data)}") from None


def _read(name: str) -> tuple[dict[str, Any], str, Path | None]:
    known = built_in_scenes()
    if name in known:
        return tomllib.loads((files(__package__) / f"{name}.toml").read_text("utf-8")), name, None
    path = Path(name)
    looks_like_path = path.suffix == ".toml" or "/" in name or "\\" in name
    if not looks_like_path and not path.is_file():
        raise InputError(
            f"scene: unknown scene {name!r}; known: {', '.join(known)}, or the path of a .toml file"
            f"{did_you_mean(name, known)}"
        )
    try:
        if path.stat().st_size > LARGEST_SCENE_FILE:
            raise InputError(f"{name}: {path.stat().st_size:,} bytes; a scene file has at most {LARGEST_SCENE_FILE:,}")
        text = path.read_bytes().decode("utf-8-sig")
    except UnicodeDecodeError:
        raise InputError(f"{name}: is not UTF-8 text; save the scene as TOML in UTF-8") from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(f"{name}: cannot be read ({reason}); give a built-in scene or a .toml file") from None
    try:
        return tomllib.loads(text), name, path.resolve().parent
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise InputError(f"{name}: not TOML: {error}") from None


def _override(data: dict[str, Any], text: str) -> None:
    key, sign, value = text.partition("=")
    parts = key.strip().split(".")
    if not sign or not all(parts):
        raise InputError(f"--set {text}: expected key=value, for instance weave.draft=twill-2/2")
    at = data
    for part in parts[:-1]:
        at = at.setdefault(part, {})
        if not isinstance(at, dict):
            raise InputError(f"--set {text}: {part} is a value, not a section")
    at[parts[-1]] = _value(value.strip())


def _value(text: str) -> Any:
    """A TOML value where it reads as one (3, true, [1, 2], "a"); anything else is text as it stands."""
    try:
        return tomllib.loads(f"x = {text}")["x"]
    except (tomllib.TOMLDecodeError, RecursionError):
        return text


def _line(error: ValidationError, data: dict[str, Any]) -> str:
    """The first thing wrong, as one line; how many more there are."""
    problems = error.errors(include_url=False)
    first = problems[0]
    path = [part for part in first["loc"] if not (isinstance(part, str) and part.startswith("function-"))]
    key = ".".join(str(part) for part in path) or "scene"
    if first["type"] == "extra_forbidden":
        allowed = _keys_at(path[:-1])
        line = f"{key}: unknown key; known: {', '.join(allowed)}{did_you_mean(str(path[-1]), allowed)}"
    elif first["type"] == "value_error":
        prefix = "" if key == "scene" else f"{key}: "
        line = prefix + str(first.get("ctx", {}).get("error", first["msg"]))
    else:
        given = first.get("input")
        shown = repr(given) if len(repr(given)) < 60 else repr(given)[:57] + "…"
        message = first["msg"].removeprefix("Input should be ")
        hint = ""
        if first["type"] == "literal_error" and isinstance(given, str):
            choices = str(first.get("ctx", {}).get("expected", "")).replace("'", "").replace(" or ", ", ").split(", ")
            hint = did_you_mean(given, choices)
        line = f"{key}: {shown}; allowed: {message}{hint}"
    more = len(problems) - 1
    return line + (f" (and {more} more to mend after this)" if more else "")


def _keys_at(path: list[Any]) -> list[str]:
    """The keys that a section allows."""
    model: Any = Scene
    for part in path:
        if not (isinstance(model, type) and issubclass(model, BaseModel)) or part not in model.model_fields:
            return []
        model = _section_of(model.model_fields[part].annotation)
    return list(model.model_fields) if isinstance(model, type) and issubclass(model, BaseModel) else []


def _section_of(annotation: Any) -> Any:
    if get_origin(annotation) in (Union, UnionType):
        return next((a for a in get_args(annotation) if a is not NoneType), annotation)
    return annotation
