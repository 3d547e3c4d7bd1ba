"""The front door: a dozen names, fetched when asked for; and the examples in docstrings are true."""

import doctest
import subprocess
import sys
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from pkgutil import walk_packages

import pytest

import taichi_cloth as tc


def with_examples() -> list[str]:
    """Modules whose docstrings hold examples; found from their text, so that the others are not imported."""
    names = ["taichi_cloth", *(found.name for found in walk_packages(tc.__path__, "taichi_cloth."))]
    specs = [find_spec(name) for name in names if not name.endswith("__main__")]
    return [s.name for s in specs if s and s.origin and "    >>> " in Path(s.origin).read_text("utf-8")]


@pytest.mark.parametrize("name", with_examples())
def test_examples_in_docstrings_are_true(name: str) -> None:
    result = doctest.testmod(import_module(name))
    assert result.attempted > 0
    assert result.failed == 0


def test_every_name_of_the_front_door_is_there() -> None:
    for name in tc.__all__:
        assert getattr(tc, name) is not None
    assert set(tc.__all__) <= set(dir(tc))
    with pytest.raises(AttributeError, match="has no attribute 'knit'"):
        tc.knit  # noqa: B018


def test_the_front_door_opens_no_room_before_it_is_asked(tmp_path: Path) -> None:
    code = "import sys, taichi_cloth\nprint([m for m in sys.modules if m.startswith('taichi')])"
    said = subprocess.run([sys.executable, "-P", "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert said.stdout.strip() == "['taichi_cloth']"
