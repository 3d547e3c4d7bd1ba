"""A person's file: taken whole, or refused in a line before it costs anything. Ours: written whole or not at all."""

import json
import os
import struct
import subprocess
import sys
import zlib
from pathlib import Path
from types import FrameType
from typing import Any

import pytest

from taichi_cloth.ground import files
from taichi_cloth.ground.errors import LONGEST, InputError
from taichi_cloth.ground.files import read_bytes, read_json, read_text, write_bytes

FUZZ = Path(__file__).with_name("fuzz.py")
MOST_MB = 1000
"""What refusing a file may take."""


def test_a_file_is_read_whole(tmp_path: Path) -> None:
    path = tmp_path / "a"
    path.write_bytes(b'\xef\xbb\xbf{"x": 1}')
    assert read_bytes(path, most=11, give="a word") == path.read_bytes()
    assert read_text(path, most=11, give="a word") == '{"x": 1}'
    assert read_json(path, most=11, give="a word") == {"x": 1}


def refused(path: str | Path, most: int = 100) -> str:
    with pytest.raises(InputError) as error:
        read_json(path, most=most, give="a word")
    assert "\n" not in str(error.value)
    assert str(error.value).endswith("give a word")
    return str(error.value)


def test_what_is_no_file_of_ours_is_refused(tmp_path: Path) -> None:
    (tmp_path / "long").write_bytes(b"x" * 101)
    assert "101 bytes; allowed: up to 100" in refused(tmp_path / "long")
    assert "No such file" in refused(tmp_path / "missing")
    assert "is a folder" in refused(tmp_path)
    assert "null byte" in refused("nothing\0here")
    assert "File name too long" in refused("x" * 5000)
    if os.path.exists("/dev/zero"):
        assert "no regular file" in refused("/dev/zero")
    if hasattr(os, "mkfifo"):
        os.mkfifo(tmp_path / "pipe")
        assert "no regular file" in refused(tmp_path / "pipe")


@pytest.mark.parametrize(
    ("content", "match"), [(b"\xff\xfe", "UTF-8"), (b"{", "not JSON"), (b"[" * 90_000, "nested too deeply")]
)
def test_what_is_no_json_is_refused(tmp_path: Path, content: bytes, match: str) -> None:
    (tmp_path / "x").write_bytes(content)
    assert match in refused(tmp_path / "x", most=100_000)


def test_whole_numbers_of_any_length_are_numbers(tmp_path: Path) -> None:
    (tmp_path / "x").write_text(f"[12, {'9' * 400}, -{'9' * 5000}]")
    assert read_json(tmp_path / "x", most=10_000, give="a word") == [12, float("inf"), float("-inf")]


def test_a_line_for_bad_input_is_never_long() -> None:
    assert len(str(InputError("x" * 10 * LONGEST))) <= LONGEST
    assert str(InputError("a\n b")) == "a b"


def deflated_zeros(count: int) -> bytes:
    """A zlib stream of so many bytes of 0, put together from one megabyte's: gigabytes take seconds to deflate."""

    def deflated(size: int, end: int) -> bytes:
        packer = zlib.compressobj(9, zlib.DEFLATED, -15)
        return packer.compress(bytes(size)) + packer.flush(end)

    megabytes, rest = divmod(count, 1 << 20)
    adler = (count % 65521) << 16 | 1
    blocks = deflated(1 << 20, zlib.Z_FULL_FLUSH) * megabytes + deflated(rest, zlib.Z_FINISH)
    return b"\x78\xda" + blocks + struct.pack(">I", adler)


def png(width: int, height: int, *, zeros: bool = False) -> bytes:
    """A PNG of so many RGBA pixels, all 0 or missing."""
    packed = deflated_zeros(height * (1 + 4 * width)) if zeros else b""
    chunks = [(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 6, 0, 0, 0)), (b"IDAT", packed), (b"IEND", b"")]
    whole = [struct.pack(">I", len(d)) + n + d + struct.pack(">I", zlib.crc32(n + d)) for n, d in chunks]
    return b"\x89PNG\r\n\x1a\n" + b"".join(whole)


def glb(count: int) -> bytes:
    """A GLB that promises so many corners, and holds none."""
    accessors = [{"componentType": 5126, "count": count, "type": "VEC3"},
                 {"componentType": 5125, "count": count, "type": "SCALAR"}]  # fmt: skip
    mesh = {"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}
    said = json.dumps({"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
                       "meshes": [mesh], "accessors": accessors}).encode()  # fmt: skip
    said += b" " * (-len(said) % 4)
    return struct.pack("<4sIIII", b"glTF", 2, 20 + len(said), len(said), 0x4E4F534A) + said


BOMBS = {
    "deep.toml": (b".".join([b"a"] * 60_000) + b"=1\n", [], "a key of more than 32 parts"),
    "quoted.toml": (b'"a\\"b".' * 40_000 + b"a=1\n", [], "a key of more than 32 parts"),
    "rows.toml": (b"[fibre]\nspheres=[" + b"[]," * 300_000 + b"]\n", [], "a list of 300,000 values; allowed: up to"),
    "large.toml": (b"#" * 1_000_001, [], "1,000,001 bytes; allowed: up to 1,000,000"),
    "wide.png": (png(26_000, 26_000, zeros=True), ["swatch", "fibre.sprite"], "26000 x 26000 pixels; allowed: up to"),
    "head.png": (png(60_000, 60_000), ["swatch", "fibre.sprite"], "60000 x 60000 pixels; allowed: up to 8192"),
    "many.glb": (glb(60_000_000), ["tshirt", "body.source"], "bytes in its accessors; allowed: up to"),
    "body.zip": (b"PK\x03\x04", ["tshirt", "body.source"], "allowed: built-in, anny, or an OBJ, PLY, GLB or STL file"),
    "lists.json": (b"[" + b"{}," * 1_600_000 + b"{}]", ["tshirt", "garment.pattern"], "file.pattern: missing"),
    "print.png": (png(26_000, 26_000, zeros=True), ["print"], "26000 x 26000 pixels; allowed: up to 8192"),
    "/dev/zero": (None, ["print"], "/dev/zero: is no regular file"),
}
"""Name: what is in it, the scene and the key that name it, and what its line must hold."""

PROGRAM = """
import json, resource, sys
sys.path.insert(0, sys.argv[1])
from fuzz import peak_mb
from taichi_cloth.ground.errors import InputError
from taichi_cloth.scenes import __main__ as command_line
resource.setrlimit(resource.RLIMIT_AS, (6_000_000_000, 6_000_000_000))
for arguments in json.load(sys.stdin):
    if arguments[0] == "print":
        from taichi_cloth.render.image.image import LARGEST_GIVEN, read_png
        try:
            read_png(arguments[1], largest=LARGEST_GIVEN)
        except InputError as error:
            line, status = str(error), 2
            print(line, file=sys.stderr)
    else:
        status = command_line._status(arguments)
    print(status, peak_mb())
"""


def test_refusing_a_file_takes_little_memory(tmp_path: Path) -> None:
    commands = []
    for name, (content, of, _) in BOMBS.items():
        path = tmp_path / name  # an absolute name stays what it is
        if content is not None:
            path.write_bytes(content)
        commands.append(
            ["print", str(path)] if of == ["print"]
            else ["plan", of[0], "--set", f"{of[1]}={path}"] if of else ["plan", str(path)]
        )  # fmt: skip
    commands.append(["plan", "swatch", "--set", "x={" + "a." * 30_000 + "a=1}"])
    done = subprocess.run(
        [sys.executable, "-P", "-c", PROGRAM, str(FUZZ.parent)],
        input=json.dumps(commands),
        capture_output=True,
        text=True,
        check=False,
    )
    said, ends = done.stderr.splitlines(), [line.split() for line in done.stdout.splitlines()]
    assert len(said) == len(ends) == len(commands), done.stderr[-2000:]
    for (name, (_, _, words)), line in zip(BOMBS.items(), said, strict=False):
        assert words in line, name
    assert {status for status, _ in ends} == {"2"}
    assert max(int(taken) for _, taken in ends) < MOST_MB, list(zip(said, ends, strict=True))


def fuzzed(count: int, seed: int) -> None:
    done = subprocess.run([sys.executable, FUZZ, str(count), str(seed)], capture_output=True, text=True, check=False)
    *bad, taken = done.stdout.splitlines() or ["nothing"]
    assert (bad, done.stderr) == ([], "")
    assert int(taken) < MOST_MB


def test_damaged_files_are_taken_or_refused() -> None:
    fuzzed(30, 1)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2, 6))
def test_many_damaged_files_are_taken_or_refused(seed: int) -> None:
    fuzzed(1000, seed)


def test_a_write_that_is_interrupted_at_any_line_leaves_the_old_file_or_the_new_one(tmp_path: Path) -> None:
    path = tmp_path / "frame.png"

    def interrupted(at: int) -> bool:
        """Writes, with an exception before the line that is run as number `at`, as a signal's may come."""
        lines = 0

        def trace(frame: FrameType, event: str, _: Any) -> Any:
            nonlocal lines
            if frame.f_code.co_filename != files.__file__:
                return None
            if event == "line":
                lines += 1
                if lines == at:
                    raise KeyboardInterrupt
            return trace

        path.write_bytes(b"old")
        before = sys.gettrace()
        sys.settrace(trace)
        try:
            write_bytes(path, b"new")
        except KeyboardInterrupt:
            return True
        finally:
            sys.settrace(before)
        return False

    at = 1
    while interrupted(at):
        assert [p.name for p in tmp_path.iterdir()] == ["frame.png"], at
        assert path.read_bytes() in (b"old", b"new"), at
        at += 1
    assert at > 5
    assert path.read_bytes() == b"new"
