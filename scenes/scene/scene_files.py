"""The files that a scene names, found by the marks of the schema (`NamesFile`), so that each key is marked once."""

import hashlib
from collections.abc import Iterator, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any, get_args, get_origin

from pydantic import BaseModel

from taichi_cloth.garment.pattern.dxf_pattern import beside

from .schema import Scene
from .section import NamesFile

__all__ = ["file_hashes", "file_keys", "files_named"]

Key = tuple[str, ...]


@lru_cache
def file_keys() -> tuple[tuple[Key, NamesFile], ...]:
    """Every key of a scene that may name a file, as its parts, * for any key or any place of a list; and its mark."""
    return tuple(_marked(Scene, ()))


def _marked(kind: Any, marks: Sequence[Any]) -> Iterator[tuple[Key, NamesFile]]:
    """Marks in a type, and the parts of the keys that lead to them."""
    yield from (((), mark) for mark in marks if isinstance(mark, NamesFile))
    if get_origin(kind) is Annotated:
        inner, *found = get_args(kind)
        yield from _marked(inner, found)
    elif isinstance(kind, type) and issubclass(kind, BaseModel):
        for name, field in kind.model_fields.items():
            yield from (((name, *rest), mark) for rest, mark in _marked(field.annotation, field.metadata))
    elif get_origin(kind) in (dict, list, tuple):
        for part in get_args(kind):
            yield from ((("*", *rest), mark) for rest, mark in _marked(part, ()))
    else:  # X | None and the like
        for part in get_args(kind):
            yield from _marked(part, ())


def _places(data: Any, keys: Sequence[str], above: str = "") -> Iterator[tuple[str, Any, Any]]:
    """Where a scene's data state a key, * for any: its whole name, the table or list it is in, and its place there."""
    found = list(data) if isinstance(data, dict) else list(range(len(data))) if isinstance(data, list) else []
    for place in found:
        if keys[0] not in ("*", place):
            continue
        if len(keys) == 1:
            yield f"{above}{place}", data, place
        else:
            yield from _places(data[place], keys[1:], f"{above}{place}.")


def files_named(data: Any) -> Iterator[tuple[str, Any, Any]]:
    """`_places` of a scene's data, as they stand in TOML, whose text is the path of a file."""
    for key, mark in file_keys():
        for name, table, place in _places(data, key):
            if isinstance(table[place], str) and mark.fits(table[place]):
                yield name, table, place


def file_hashes(scene: Scene) -> dict[str, str]:
    """Key to SHA-256 of the file that it names, and of the TOML that belongs to a DXF; of one that cannot be read,
    which is refused later, nothing."""
    found = {}
    for name, table, place in files_named(scene.model_dump(mode="json")):
        path = Path(table[place])
        both = {name: path} | ({f"{name}, .toml": beside(path)} if path.suffix.lower() == ".dxf" else {})
        for key, one in both.items():
            try:
                if one.is_file():
                    with one.open("rb") as file:
                        found[key] = hashlib.file_digest(file, "sha256").hexdigest()
            except (OSError, ValueError):  # a null byte in a path
                continue
    return found
