"""What `taichi-cloth profile` prints, and that the work it times is the work it says. No time is tested."""

import re

import numpy as np
import pytest

from taichi_cloth.ground.runtime import Runtime
from taichi_cloth.scenes.__main__ import _status
from taichi_cloth.scenes.measure import profile
from taichi_cloth.scenes.prepare.weave_layout import prepare_fabric


def test_the_fabric_it_builds_has_at_least_the_particles_asked_and_few_more() -> None:
    assert 100_000 <= prepare_fabric(profile.woven_of_at_least(100_000)).particles < 130_000


def test_the_garment_has_its_size_count_and_radius_on_the_picture() -> None:
    particles = profile.garment(20_000)
    assert len(particles) == 20_000
    assert particles.half_length is None  # round splats
    size = np.ptp(particles.position, axis=0)
    np.testing.assert_allclose(size, [0.38, 0.62, 0.25], rtol=0.12)
    camera = profile._turned(5)
    pixels = camera.project(particles.position)
    assert np.all((pixels[:, :2] > 0) & (pixels[:, :2] < profile.SIZE))
    depth = np.linalg.norm(particles.position - camera.eye, axis=1)
    assert abs(np.mean(camera.focal * particles.radius / depth) - profile.GARMENT_RADIUS_PX) < 0.15
    outward = np.einsum("ij,ij->i", particles.normal[:, [0, 2]], particles.position[:, [0, 2]])
    assert np.mean(outward) > 0  # the right side of the cloth is outside


@pytest.mark.usefixtures("keep_taichi")
def test_it_prints_every_stage_once(taichi_runtime: Runtime, capsys: pytest.CaptureFixture[str]) -> None:
    small = ["weave.ends=4", "weave.picks=4", "light.shadows=false", "light.occlusion=false", "stage.ground=false"]
    tiny = ["plain", *(word for text in small for word in ("--set", text)), "--repeats", "1"]
    status = _status(["profile", *tiny])
    done = capsys.readouterr()
    assert (status, done.err) == (0, "")
    assert "Taichi on " in done.out.splitlines()[0]
    assert f"{taichi_runtime.threads} thread" in done.out.splitlines()[0]
    stages = re.findall(r"^  (\w[\w ]*?) +(\d+\.\d) ms  \(\d+\.\d to \d+\.\d\)", done.out, re.MULTILINE)
    names = ["lay out", "templates", "key points", "particles", "project", "sort", "bin", "raster", "frame"]
    assert [name for name, _ in stages] == [*names, "built", "drawn"]
    assert "a garment of 377,508 particles" in done.out
    built = re.search(r"built .*?([\d,]+) particles, .*(met|not met)$", done.out, re.MULTILINE)
    assert built is not None
    assert int(built[1].replace(",", "")) >= 500_000
