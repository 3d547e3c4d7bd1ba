"""Keys that name files: marked once in the schema, and what follows of the mark."""

import re
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args, get_origin

import pytest
from pydantic import BaseModel

from taichi_cloth.scenes.commands.sequence import fingerprint
from taichi_cloth.scenes.scene.load import load_scene
from taichi_cloth.scenes.scene.scene_files import file_hashes, file_keys
from taichi_cloth.scenes.scene.schema import Scene
from taichi_cloth.scenes.scene.section import NamesFile

WIF = Path(__file__).parents[1] / "data" / "wif" / "schort.wif"
FILE_WORDS = re.compile(r"\bfile\b|\bpath\b|\.[a-z]{3,4}\b|\b(PNG|OBJ|WIF|BVH|GLB|JSON)\b")
"""What the description of a key that names a file cannot do without."""
KEYS = dict(file_keys())


def text_keys(kind: Any = Scene, above: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], str]]:
    """Every key of a scene that may hold text, as `file_keys` writes it, and its description."""
    if isinstance(kind, type) and issubclass(kind, BaseModel):
        for name, field in kind.model_fields.items():
            described = [(key, text or field.description or "") for key, text in text_keys(field.annotation)]
            yield from (((*above, name, *key), text) for key, text in described)
    elif kind is str:
        yield above, ""
    else:
        star = ("*",) if get_origin(kind) in (dict, list, tuple) else ()
        parts = get_args(kind)[1:] if get_origin(kind) is dict else get_args(kind)
        for part in parts:
            yield from text_keys(part, above + star)


def built(key: tuple[str, ...], text: str, kind: Any = Scene) -> Any:
    """The least of a scene that has this text at a key; what else the sections need is left out."""
    if not key:
        return text
    if isinstance(kind, type) and issubclass(kind, BaseModel):
        return kind.model_construct(**{key[0]: built(key[1:], text, kind.model_fields[key[0]].annotation)})
    if get_origin(kind) is dict:
        return {"front": built(key[1:], text, get_args(kind)[1])}
    if get_origin(kind) in (list, tuple):
        made = [built(key[1:], text, get_args(kind)[0])]
        return made if get_origin(kind) is list else tuple(made)
    section = next(p for p in get_args(kind) if get_origin(p) in (dict, list, tuple) or hasattr(p, "model_fields"))
    return built(key, text, section)


def test_every_key_whose_description_speaks_of_a_file_is_marked() -> None:
    told = {key for key, text in text_keys() if FILE_WORDS.search(text)}
    assert told == set(KEYS)


@pytest.mark.parametrize(("key", "mark"), file_keys(), ids=[".".join(key) for key in KEYS])
def test_an_edited_file_changes_the_fingerprint(key: tuple[str, ...], mark: NamesFile, tmp_path: Path) -> None:
    path = tmp_path / f"mine{mark.endings[0] if mark.endings else '.any'}"
    path.write_text("one")
    scene = built(key, str(path))
    assert len(file_hashes(scene)) == 1
    before = fingerprint(scene, "turntable")
    assert fingerprint(scene, "turntable") == before
    path.write_text("two")
    assert fingerprint(scene, "turntable") != before


def test_a_path_in_a_scene_file_is_taken_from_where_that_lies(tmp_path: Path) -> None:
    for draft in ("a.wif", "d.wif"):
        shutil.copy(WIF, tmp_path / draft)
    (tmp_path / "mine.toml").write_text(
        '[garment]\npattern = "tee.json"\nweaves = { front = "a.wif", back = "plain" }\n'
        'prints = { front = { file = "p.png" } }\n[body]\nsource = "b.obj"\nmotion = "walk"\nprimitives = "fit.json"\n'
        '[yarn]\n[weave]\ndraft = "d.wif"\n'
    )
    scene = load_scene(str(tmp_path / "mine.toml"), ["body.source=here.obj"])
    assert scene.garment is not None
    assert scene.body is not None
    assert scene.weave is not None
    assert scene.garment.pattern == str(tmp_path / "tee.json")
    assert scene.garment.weaves == {"front": str(tmp_path / "a.wif"), "back": "plain"}
    assert scene.garment.prints["front"].file == str(tmp_path / "p.png")
    assert (scene.body.source, scene.body.motion) == ("here.obj", "walk")
    assert scene.body.primitives == str(tmp_path / "fit.json")
    assert scene.weave.draft == str(tmp_path / "d.wif")
