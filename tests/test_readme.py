"""What README shows works as it stands: its Python lines, its pictures, its commands."""

import re
from pathlib import Path

import pytest

from taichi_cloth.scenes.scene.load import built_in_scenes, load_scene

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text("utf-8")


@pytest.mark.usefixtures("keep_taichi")
def test_the_python_lines_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]):
    code = re.search(r"```python\n(.*?)```", README, re.DOTALL)
    assert code is not None
    small = code[1].replace("(1280, 720)", "(96, 64)")
    assert small != code[1]
    monkeypatch.chdir(tmp_path)
    exec(compile(small, "README.md", "exec"), {})
    assert "mass" in capsys.readouterr().out
    assert {p.name for p in tmp_path.iterdir()} == {"view_0.png", "view_9.png"}


def test_every_picture_is_there():
    pictures = re.findall(r"\]\((docs/[^)]+)\)", README)
    assert len(pictures) > 8
    for picture in pictures:
        assert (ROOT / picture).is_file(), picture


@pytest.mark.parametrize("line", re.findall(r"taichi-cloth (?:turntable|animate) ([^`\n#]+)", README))
def test_every_scene_and_override_it_names_is_allowed(line: str, monkeypatch: pytest.MonkeyPatch):
    import shlex

    words = shlex.split(line.strip())
    overrides = [words[k + 1] for k, word in enumerate(words) if word == "--set"]
    known = [o for o in overrides if "my-draft.wif" not in o]
    monkeypatch.chdir(ROOT)
    if words[0] in built_in_scenes():
        load_scene(words[0], known)
    else:
        assert words[0] == "SCENE"


def test_every_file_the_house_names_is_there():
    """From a step of the paper to the file that takes it; a name alone lies beside the one before it."""
    steps = re.findall(r"^\| [\d., ]+ \|.*\| (.*) \|$", (ROOT / "docs" / "house.md").read_text("utf-8"), re.MULTILINE)
    assert len(steps) > 15
    for step in steps:
        folder = ROOT
        for name in re.findall(r"`([\w/]+\.py)`", step):
            path = ROOT / name if "/" in name else folder / name
            assert path.is_file(), f"{name} in: {step}"
            folder = path.parent
