"""How far a run is where standard error is no terminal: a line now and then, and none of what is quick."""

import time

import pytest

from taichi_cloth.scenes.commands.progress import progress, staged


@pytest.fixture(autouse=True)
def clock(monkeypatch):
    """Ten seconds go by from look to look."""
    times = iter(range(0, 10_000, 10))
    monkeypatch.setattr(time, "monotonic", lambda: float(next(times)))


def test_stages_say_a_line_now_and_then(capsys):
    with staged() as (each, say):
        for frame in range(1, 8):
            each("sewing", frame, 240)
        say("done")
    out, err = capsys.readouterr()
    assert out == "done\n"
    assert err.splitlines() == ["sewing 3 of 240", "sewing 6 of 240"]


def test_what_goes_on_by_steps_says_them_too(capsys):
    with progress() as bar:
        task = bar.add_task("frames", total=36)
        bar.advance(task)
        assert capsys.readouterr().err == ""
        bar.advance(task)
        bar.advance(task)
    assert capsys.readouterr().err == "frames 3 of 36\n"
