"""Damaged files for each reader of what a person gives: run as a program, it prints a line for each that ended badly.

    python tests/ground/fuzz.py FILES SEED

A reader either takes a file or refuses it with InputError in one line; anything else is printed, with the file kept in
a temporary folder. Memory beyond LIMIT is refused by the system. The last line is the largest memory taken [MB].
"""

import io
import json
import resource
import struct
import sys
import tempfile
import traceback
import warnings
import zlib
from collections.abc import Callable, Iterator
from copy import deepcopy
from pathlib import Path
from random import Random
from typing import Any

import cv2
import numpy as np
import trimesh

from taichi_cloth.body.figure.anthropometry import measures_of
from taichi_cloth.body.figure.figure import Girths, draw
from taichi_cloth.body.files.meshfile import body_from_file
from taichi_cloth.body.moving.bvh import CHANNELS, bvh_motion
from taichi_cloth.body.moving.smpl import smpl_motion
from taichi_cloth.body.primitives.primitive_file import load_primitives, primitives_json
from taichi_cloth.body.primitives.primitives import Primitive
from taichi_cloth.garment.fit.fitted import fitted
from taichi_cloth.garment.pattern.cut import cut
from taichi_cloth.garment.pattern.dxf_pieces import read_pieces
from taichi_cloth.garment.pattern.garmentcode import read_garmentcode
from taichi_cloth.ground.errors import InputError
from taichi_cloth.render.data.sprites import sheet_from_png
from taichi_cloth.render.image.image import read_png
from taichi_cloth.scenes.scene.load import load_scene
from taichi_cloth.weave.wif import read_wif

sys.path.insert(0, str(Path(__file__).parents[1]))
from figures import plain_landmarks  # as pytest finds it

DATA = Path(__file__).parents[1] / "data"
SCENES = Path(__file__).parents[2] / "scenes"
LIMIT = 8_000_000_000
"""Of address space, of which libraries map a few times what they use [bytes]."""

NASTY = (
    b"-1", b"0", b"1e308", b"-1e308", b"1e-320", b"nan", b"inf", b"99999999999", b"9" * 400, b"9" * 5000, b"null",
    b"true", b"[]", b"{}", b'""', b"\0", b"\xff\xfe", b"'", b'"', b"\n\n", b"=", b"[[", b"}", b"1/2//3", b"a.a.a.a.a",
    b"-", b"../x", b"/dev/zero", b"%s", b"2e7",
)  # fmt: skip
WORDS = b" \t\r\n,:;=[]{}()\"'"
VALUES = (None, True, -1, 0, 1, 7, 0.5, 1e308, -1e-320, float("nan"), float("inf"), 10**400, 2e7, "", "x", "../x", [],
          {}, [1], [1, 2], [[1, 2]], [1, 2, 3], {"x": 1}, [None, None], 60_000_000)  # fmt: skip


def mutated(seed: bytes, random: Random) -> bytes:
    """A file with one to four things wrong: in what it says, where its kind is known, or in its bytes."""
    times = random.randint(1, 4)
    if random.random() < 0.7:
        if seed[:1] == b"{":
            return _other_json(seed, random, times)
        if seed[:4] == b"glTF":
            length = struct.unpack("<I", seed[12:16])[0]
            said = _other_json(seed[20 : 20 + length].strip(), random, times)
            said += b" " * (-len(said) % 4)
            rest = seed[20 + length :]
            return struct.pack("<4sIIII", b"glTF", 2, 20 + len(said) + len(rest), len(said), 0x4E4F534A) + said + rest
        if seed[:4] == b"\x89PNG":
            return _other_png(seed, random)
        if seed.isascii():
            data = bytearray(seed)
            for _ in range(times):
                _other_word(data, random)
            return bytes(data)
    data = bytearray(seed)
    for _ in range(times):
        _other_bytes(data, random)
    return bytes(data)


def _other_json(seed: bytes, random: Random, times: int) -> bytes:
    document = json.loads(seed)
    for _ in range(times):
        at = document
        while True:
            keys = list(at) if isinstance(at, dict) else list(range(len(at)))
            if not keys:
                break
            key = random.choice(keys)
            if isinstance(at[key], dict | list) and random.random() < 0.8:
                at = at[key]
                continue
            if random.random() < 0.2:
                del at[key]
            else:
                at[key] = deepcopy(random.choice(VALUES))
            break
    return json.dumps(document).encode()


def _other_png(seed: bytes, random: Random) -> bytes:
    """A PNG whose chunks are whole, and one of them is not what it should be."""
    chunks, at = [], 8
    while at < len(seed):
        length = struct.unpack(">I", seed[at : at + 4])[0]
        chunks.append([seed[at + 4 : at + 8], bytearray(seed[at + 8 : at + 8 + length])])
        at += 12 + length
    chunk = random.choice(chunks)
    if chunk[1] and random.random() < 0.8:
        chunk[1][random.randrange(len(chunk[1]))] = random.choice((0, 1, 2, 8, 16, 127, 255))
    else:
        chunks.insert(random.randrange(len(chunks)), [random.choice((b"PLTE", b"tRNS", b"IDAT", b"acTL")), chunk[1]])
    whole = [struct.pack(">I", len(d)) + n + d + struct.pack(">I", zlib.crc32(n + bytes(d))) for n, d in chunks]
    return seed[:8] + b"".join(whole)


def _other_word(data: bytearray, random: Random) -> None:
    low = high = random.randrange(len(data) + 1)
    while low > 0 and data[low - 1] not in WORDS:
        low -= 1
    while high < len(data) and data[high] not in WORDS:
        high += 1
    data[low:high] = random.choice(NASTY)


def _other_bytes(data: bytearray, random: Random) -> None:
    at = random.randrange(len(data) + 1)
    end = min(len(data), at + int(2 ** random.uniform(0, 8)))
    kind = random.randrange(6)
    if kind == 0:
        data[at:end] = b""
    elif kind == 1:
        data[at:at] = data[at:end] * random.randint(1, 5)
    elif kind == 2:
        del data[at:]
    elif kind == 3:
        data[at : at + 4] = struct.pack("<I", random.choice((0, 1, 0x7FFFFFFF, 0xFFFFFFFF, 0x00FFFFFF, 60000)))
    elif kind == 4:
        data[at : at + 1] = bytes([random.randrange(256)])
    else:
        there = random.randrange(len(data) + 1)
        data[there:there] = data[at:end]


def _bvh() -> bytes:
    """A person of few joints, 3 frames."""
    tree = ("Hips", [("Spine", [("LeftArm", [("LeftForeArm", [])]), ("RightArm", [])]),
                     ("LeftUpLeg", [("LeftLeg", [("LeftFoot", [])])]),
                     ("RightUpLeg", [("RightLeg", [("RightFoot", [])])])])  # fmt: skip
    lines = ["HIERARCHY"]

    def put(joint: tuple, word: str) -> int:
        name, children = joint
        side = 10 * (name.startswith("Left") - name.startswith("Right"))
        up = -40 if "Leg" in name or "Foot" in name else 30
        kinds = CHANNELS if word == "ROOT" else CHANNELS[3:]
        lines.extend([f"{word} {name}", "{", f"OFFSET {side} {up} 0", f"CHANNELS {len(kinds)} {' '.join(kinds)}"])
        count = len(kinds) + sum(put(child, "JOINT") for child in children)
        lines.extend([] if children else ["End Site", "{", "OFFSET 0 -10 0", "}"])
        lines.append("}")
        return count

    width = put(tree, "ROOT")
    lines += ["MOTION", "Frames: 3", "Frame Time: 0.0333", *(" ".join(["1.5"] * width) for _ in range(3))]
    return "\n".join(lines).encode()


def _npz() -> bytes:
    """A person of SMPL, 3 frames."""
    out = io.BytesIO()
    np.savez_compressed(out, poses=np.full((3, 72), 0.1), trans=np.zeros((3, 3)), mocap_framerate=30.0)
    return out.getvalue()


def _png(channels: int, kind: type) -> bytes:
    image = Random(1).randbytes(24 * 20 * 4 * 2)
    pixels = np.frombuffer(image, kind)[: 24 * 20 * channels].reshape(24, 20, channels)
    return cv2.imencode(".png", pixels)[1].tobytes()


def _primitives() -> bytes:
    start, end = np.zeros(3), np.array([0, 0.3, 0])
    across = np.array([1.0, 0, 0])
    return primitives_json(
        [
            Primitive(kind="sphere", start=start, end=start, radii=(0.1, 0.1), part="head", bone=5),
            Primitive(kind="cylinder", start=start, end=end, radii=(0.1, 0.05), part="arm", bone=7),
            Primitive(kind="elliptic", start=start, end=end, radii=(0.1, 0.05), across=across, rounding=0.01),
        ]
    )


def _garment(path: Path) -> object:
    """What `plan` makes of a pattern."""
    pattern = fitted(read_garmentcode(path), plain_landmarks())
    return cut(pattern, (0.08, 0.08))


def seeds() -> Iterator[tuple[str, Callable[[Path], object], list[bytes]]]:
    """The ending of a file's name, what reads it, and sound files."""
    skeleton = draw("female", measures_of("female", {}), Girths()).skeleton
    yield ".toml", lambda path: load_scene(str(path)), [path.read_bytes() for path in sorted(SCENES.glob("*.toml"))]
    yield ".wif", read_wif, [path.read_bytes() for path in sorted((DATA / "wif").glob("*.wif"))]
    yield ".json", _garment, [(DATA / "patterns" / f"{name}.json").read_bytes() for name in ("tee", "skirt_4_panels")]
    yield ".dxf", read_pieces, [(DATA / "patterns" / "own_tee.dxf").read_bytes()]
    yield ".json", load_primitives, [_primitives()]
    yield ".bvh", lambda path: bvh_motion(path, skeleton).pose(1.03), [_bvh()]
    yield ".npz", lambda path: smpl_motion(path, skeleton).pose(1.03), [_npz()]
    yield ".png", lambda path: sheet_from_png([path]), [_png(4, np.uint8), _png(4, np.uint16)]
    yield ".png", read_png, [_png(3, np.uint8), _png(1, np.uint16), _png(4, np.uint8)]
    body = trimesh.creation.icosphere(subdivisions=2)
    body.apply_transform(np.diag([0.2, 0.85, 0.12, 1.0]))
    for ending, text in (("obj", {}), ("ply", {}), ("ply", {"encoding": "ascii"}), ("stl", {}), ("glb", {})):
        found: Any = body.export(file_type=ending, **text)
        yield f".{ending}", body_from_file, [found.encode() if isinstance(found, str) else found]
    found = body.export(file_type="stl_ascii")
    yield ".stl", body_from_file, [found.encode()]


def bad_ends(folder: Path, count: int, seed: int) -> Iterator[str]:
    """A line for each of `count` damaged files a reader that is neither taken nor refused in a line."""
    for number, (ending, read, sound) in enumerate(seeds()):
        for whole in sound:
            (folder / f"whole{ending}").write_bytes(whole)
            read(folder / f"whole{ending}")
            (folder / f"whole{ending}").unlink()
        for k in range(count):
            random = Random(f"{seed} {number} {k}")
            path = folder / f"{number}-{k}{ending}"
            path.write_bytes(mutated(random.choice(sound), random))
            try:
                read(path)
            except InputError as error:
                if "\n" in str(error) or len(str(error)) > 2000:
                    yield f"{path}: more than a line"
                    continue
            except BaseException as error:
                where = traceback.extract_tb(error.__traceback__)[-1]
                yield f"{path}: {type(error).__name__}: {str(error)[:200]} ({where.filename}:{where.lineno})"
                continue
            path.unlink()


def peak_mb() -> int:
    """Largest resident memory of this program; of Linux not from `getrusage`, which counts that of who started it."""
    status = Path("/proc/self/status")
    if not status.exists():
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1000
    (line,) = (line for line in status.read_text("ascii").splitlines() if line.startswith("VmHWM"))
    return int(line.split()[1]) // 1000


if __name__ == "__main__":
    resource.setrlimit(resource.RLIMIT_AS, (LIMIT, LIMIT))
    warnings.simplefilter("error", RuntimeWarning)
    place = Path(tempfile.mkdtemp(prefix="fuzz-"))
    for line in bad_ends(place, int(sys.argv[1]), int(sys.argv[2])):
        print(line)
    if not any(place.iterdir()):
        place.rmdir()
    print(peak_mb())
