"""The wheel is whole, the rooms import each other as they may, and importing starts nothing."""

import ast
import importlib.metadata
import re
import shutil
import subprocess
import sys
import tomllib
import zipfile
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).parents[1]
ROOTS = {"taichi_cloth": "taichi_cloth", "taichi_cloth/render": "render", "taichi_cloth/scenes": "scenes"}
"""Folder in the wheel: folder in the repository."""

ROOMS = {
    f"{inside}/{path.relative_to(REPOSITORY / root).as_posix()}".removesuffix("/."): path.relative_to(
        REPOSITORY
    ).as_posix()
    for inside, root in ROOTS.items()
    for path in (REPOSITORY / root, *(REPOSITORY / root).rglob("*/"))
    if any(path.glob("*.py"))
}
"""The same for every folder that holds modules."""

LARGEST_ROOM = 15
"""Modules in a folder, `__init__.py` apart."""

LONGEST_FUNCTION, MOST_ARGUMENTS = 120, 12
"""Lines from `def` to the end; arguments, `self` apart, of what Taichi compiles."""

FRONT_DOOR = REPOSITORY / "taichi_cloth" / "__init__.py"
"""Names what lies in any room, for type checkers alone; it imports a room when one of its names is asked for."""

MODULES = sorted({path for root in ROOTS.values() for path in (REPOSITORY / root).rglob("*.py")} - {FRONT_DOOR})
PROJECT = tomllib.loads((REPOSITORY / "pyproject.toml").read_text("utf-8"))


def belongs_in_wheel() -> set[str]:
    """Every module, scene, data file and marker of the rooms, as the wheel should name it."""
    return {
        f"{inside}/{path.relative_to(REPOSITORY / room).as_posix()}"
        for inside, room in ROOMS.items()
        for pattern in ("*.py", "*.toml", "*.json", "py.typed")
        for path in (REPOSITORY / room).glob(pattern)
    }


def test_every_folder_with_modules_is_a_listed_package() -> None:
    listed = PROJECT["tool"]["setuptools"]["packages"]
    assert sorted(listed) == sorted(inside.replace("/", ".") for inside in ROOMS)


def test_no_room_is_an_attic() -> None:
    counts = {
        room: len([p for p in (REPOSITORY / room).glob("*.py") if p.stem != "__init__"]) for room in ROOMS.values()
    }
    assert {room: count for room, count in counts.items() if count > LARGEST_ROOM} == {}


@pytest.mark.slow
def test_the_wheel_holds_every_module_and_scene(tmp_path: Path) -> None:
    clone = tmp_path / "clone"  # a copy, so that nothing an older build left behind gets in
    clone.mkdir()
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(REPOSITORY / name, clone / name)
    for room in ROOTS.values():
        shutil.copytree(
            REPOSITORY / room, clone / room, ignore=shutil.ignore_patterns("__pycache__"), dirs_exist_ok=True
        )
    command = [sys.executable, "-m", "pip", "wheel", ".", "--quiet", "--no-deps", "--wheel-dir", str(tmp_path)]
    subprocess.run(command, cwd=clone, check=True)
    (wheel,) = tmp_path.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        held = {name for name in archive.namelist() if ".dist-info/" not in name}
        scripts = next(archive.read(n).decode() for n in archive.namelist() if n.endswith("entry_points.txt"))
    assert held == belongs_in_wheel()
    assert "taichi-cloth = taichi_cloth.scenes.__main__:main" in scripts


@cache
def nodes(path: Path) -> list[ast.AST]:
    return list(ast.walk(ast.parse(path.read_text("utf-8"))))


def imports(path: Path) -> Iterator[tuple[int, str]]:
    """(line, absolute dotted name) of everything a module imports, wherever in it."""
    here = path.parent.relative_to(REPOSITORY).as_posix()
    inside = next((i for i, room in ROOMS.items() if here == room), here)
    package = inside.replace("/", ".").split(".")
    for node in nodes(path):
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            stem = ".".join([*base, *([node.module] if node.module else [])])
            yield from ((node.lineno, f"{stem}.{alias.name}") for alias in node.names)


def floor_of(name: str) -> str:
    """Which part of the house an imported dotted name is of: render, scenes, core, or its ground; "" if elsewhere."""
    parts = name.split(".")
    if parts[0] in ("render", "scenes"):
        return parts[0]
    if parts[0] != "taichi_cloth":
        return ""
    return parts[1] if len(parts) > 1 and parts[1] in ("render", "scenes", "ground") else "core"


def folder_of(name: str) -> str | None:
    """The folder of the repository that an imported dotted name lies in; None if it is not ours."""
    parts = name.split(".")
    if parts[0] != "taichi_cloth":
        return None
    while "/".join(parts) not in ROOMS:
        parts.pop()
    return ROOMS["/".join(parts)]


def arrows() -> dict[str, set[str]]:
    """Folder to the folders that its modules import from, wherever in them."""
    found: dict[str, set[str]] = {room: set() for room in ROOMS.values()}
    for path in MODULES:
        here = path.parent.relative_to(REPOSITORY).as_posix()
        for _, name in imports(path):
            there = folder_of(name)
            if there not in (None, here, "taichi_cloth"):  # taichi_cloth itself: the version
                found[here].add(str(there))
    return found


def functions() -> list[tuple[str, ast.FunctionDef]]:
    """Name and tree of every function of the rooms."""
    return [
        (f"{path.relative_to(REPOSITORY).as_posix()}: {node.name}", node)
        for path in MODULES
        for node in nodes(path)
        if isinstance(node, ast.FunctionDef)
    ]


def test_no_function_is_longer_than_two_screens() -> None:
    lengths = {name: (node.end_lineno or 0) - node.lineno + 1 for name, node in functions()}
    assert {name: lines for name, lines in lengths.items() if lines > LONGEST_FUNCTION} == {}


def test_kernels_take_few_arguments() -> None:
    def compiled(node: ast.FunctionDef) -> bool:
        return any(ast.unparse(made) in ("ti.kernel", "ti.func") for made in node.decorator_list)

    counts = {
        name: len([one for one in ast.walk(node.args) if isinstance(one, ast.arg) and one.arg != "self"])
        for name, node in functions()
        if compiled(node)
    }
    assert len(counts) > 100
    assert {name: count for name, count in counts.items() if count > MOST_ARGUMENTS} == {}


def test_a_type_checker_is_muted_line_by_line_or_for_one_rule() -> None:
    """In a file of kernels one rule that many lines would break, with a comment above that says why."""
    wrong = []
    for path in MODULES:
        lines = path.read_text("utf-8").splitlines()
        mutes = [k for k, line in enumerate(lines) if re.match(r"#\s*(pyright|type):", line)]
        if len(mutes) > 1 or any(
            not re.fullmatch(r"# pyright: report\w+=false", lines[k]) or not lines[k - 1].startswith("# ")
            for k in mutes
        ):
            wrong.append(path.relative_to(REPOSITORY).as_posix())
    assert wrong == []


def test_arrows_between_folders_go_one_way() -> None:
    found = arrows()
    while free := {room for room, used in found.items() if not used}:  # rooms that need no other: take them away
        found = {room: used - free for room, used in found.items() if room not in free}
    assert found == {}, "these import each other in a circle"


@pytest.mark.parametrize("path", MODULES, ids=lambda p: p.relative_to(REPOSITORY).as_posix())
def test_rooms_import_only_what_they_may(path: Path) -> None:
    room = path.relative_to(REPOSITORY).parts[0]
    forbidden = {"taichi_cloth": {"render", "scenes"}, "render": {"core", "scenes"}, "scenes": set()}[room]
    # Switches for Taichi are set in taichi_cloth/__init__.py; that is not the core, and no room needs to import it.
    wrong = [f"{path.name}:{line} imports {name}" for line, name in imports(path) if floor_of(name) in forbidden]
    assert wrong == []


def test_the_import_check_sees_relative_and_absolute_imports(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys.modules[__name__], "REPOSITORY", tmp_path)
    path = tmp_path / "render" / "x.py"
    path.parent.mkdir()
    path.write_text(
        "from ..fibre import contour\nfrom . import camera\nimport taichi_cloth.yarn\n"
        "import numpy\nfrom taichi_cloth.ground import errors\n"
    )
    assert [floor_of(name) for _, name in imports(path)] == ["core", "render", "core", "", "ground"]


def test_only_the_runtime_starts_taichi() -> None:
    callers = {
        path.relative_to(REPOSITORY).as_posix()
        for path in MODULES
        for node in nodes(path)
        if (
            isinstance(node, ast.Attribute)
            and node.attr == "init"
            and getattr(node.value, "id", "") in ("ti", "taichi")
        )
        or (isinstance(node, ast.ImportFrom) and node.module == "taichi" and any(a.name == "init" for a in node.names))
    }
    assert callers == {"taichi_cloth/ground/runtime.py"}


def python(code: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """Run code in a new interpreter, in a folder where no source tree can be imported by accident."""
    return subprocess.run(
        [sys.executable, "-P", "-c", code], cwd=folder, capture_output=True, text=True, check=True, timeout=120
    )


def test_importing_everything_prints_nothing_and_starts_nothing(tmp_path: Path) -> None:
    names = [
        ".".join([*inside.split("/"), path.stem])
        for inside, room in ROOMS.items()
        for path in sorted((REPOSITORY / room).glob("*.py"))
        if path.stem not in ("__init__", "__main__")
    ]
    done = python(
        f"import importlib, sys\nfor name in {names!r}: importlib.import_module(name)\n"
        "from taichi.lang import impl\nassert impl.get_runtime().prog is None, 'Taichi was started'",
        tmp_path,
    )
    assert (done.stdout, done.stderr) == ("", "")


def test_the_three_packages_import_without_taichi(tmp_path: Path) -> None:
    done = python(
        "import sys, taichi_cloth, taichi_cloth.render, taichi_cloth.scenes; print('taichi' in sys.modules)", tmp_path
    )
    assert (done.stdout.strip(), done.stderr) == ("False", "")


@pytest.mark.parametrize(
    "arguments", [["--version"], ["scenes"], ["plan", "swatch"], ["plan", "twist"], ["fabric", "swatch"]]
)
def test_commands_that_compute_nothing_do_not_load_taichi(arguments: list[str], tmp_path: Path) -> None:
    done = python(
        "import sys; from taichi_cloth.scenes.__main__ import main\n"
        f"try: main({arguments!r})\n"
        "except SystemExit as end: print(end.code, 'taichi' in sys.modules)",
        tmp_path,
    )
    assert done.stdout.splitlines()[-1] == "0 False"
    assert done.stderr == ""


def test_the_version_is_stated_once() -> None:
    import taichi_cloth

    assert taichi_cloth.__version__ == PROJECT["project"]["version"] == importlib.metadata.version("taichi-cloth")


WRONG = """import taichi as ti
from taichi_cloth.ground import runtime

runtime.start("cpu", threads=1)


@ti.kernel
def kernel() -> ti.i32:
    return (1 +
        missing)


kernel()
"""


def test_an_error_in_a_kernel_names_its_file_line_and_name(tmp_path: Path) -> None:
    (tmp_path / "wrong.py").write_text(WRONG)
    done = subprocess.run([sys.executable, "-P", "wrong.py"], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert 'wrong.py", line 10, in kernel' in done.stderr
    assert '"missing" is not defined' in done.stderr
