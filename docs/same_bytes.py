"""Do two states of this repository make the same pictures and the same motion, byte for byte?

    python docs/same_bytes.py REVISION              # that revision of git against the working tree
    python docs/same_bytes.py REVISION OTHER        # two revisions
    python docs/same_bytes.py REVISION --only drape # one of the runs below

Each state is installed into a folder of its own, with caches of its own, so that nothing one made is read by the other;
what is compared are the frames (PNG, by their pixels' file bytes), the passes of `still`, and the arrays of saved
states. Run it in an environment that has this project's dependencies. Exit code 1 if anything differs.
"""

import argparse
import hashlib
import json
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
SMALL = ["--size", "480x360"]
RUNS: dict[str, list[str]] = {
    "swatch": ["turntable", "swatch", "--views", "2", *SMALL],
    "satin": ["turntable", "satin", "--views", "2", *SMALL],
    "tartan": ["turntable", "tartan", "--views", "2", *SMALL],
    "yarn": ["turntable", "yarn", "--views", "2", *SMALL],
    "fibre": ["turntable", "fibre", "--views", "2", *SMALL],
    "closeup": ["turntable", "closeup", "--views", "2", *SMALL],
    "twist": ["animate", "twist", "--frames", "4", *SMALL],
    "drape": ["animate", "drape", "--frames", "11", *SMALL],
    "flag": ["animate", "flag", "--frames", "21", *SMALL],
    "tshirt": ["still", "tshirt", *SMALL],
    "dress": ["animate", "dress", "--frames", "6", *SMALL],
    "zoom": ["zoom", "swatch", "--frames", "3", *SMALL],
    "passes": ["still", "swatch", "--passes", "colour,depth,normal,mask,id", *SMALL],
}


def installed(revision: str | None, folder: Path) -> Path:
    """The package of a revision (None: the working tree) in `folder`/site."""
    source = folder / "source"
    if revision is None:
        files = subprocess.run(
            ["git", "ls-files", "-co", "--exclude-standard", "-z"], cwd=ROOT, check=True, capture_output=True, text=True
        ).stdout.split("\0")
        for name in filter(None, files):
            if (ROOT / name).is_file():
                (source / name).parent.mkdir(parents=True, exist_ok=True)
                (source / name).write_bytes((ROOT / name).read_bytes())
    else:
        source.mkdir(parents=True)
        packed = subprocess.run(["git", "archive", revision], cwd=ROOT, check=True, capture_output=True).stdout
        subprocess.run(["tar", "-x"], cwd=source, check=True, input=packed)
    site = folder / "site"
    install = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--target", str(site), str(source)]
    subprocess.run(install, check=True)
    return site


def made(site: Path, arguments: list[str], out: Path) -> dict[str, str]:
    """The `hashes` of what one command writes, or its exit code and line where it failed."""
    environment = os.environ | {
        "PYTHONPATH": str(site),
        "TAICHI_CLOTH_CACHE": str(site.parent / "cache"),
        "TI_OFFLINE_CACHE_FILE_PATH": str(site.parent.with_name(f"{site.parent.name}-kernels")),
    }
    command = [sys.executable, "-m", "taichi_cloth.scenes", *arguments, "--out", str(out)]
    run = subprocess.run(command, env=environment, cwd=site.parent, capture_output=True, text=True)
    if run.returncode:
        return {"exit code": f"{run.returncode}: {run.stderr.strip()}"}
    return hashes(out)


def hashes(out: Path) -> dict[str, str]:
    """File name to hash of the pictures in a folder, and of the arrays of a state."""
    found = {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in sorted(out.glob("*.png"))}
    for path in out.glob("*.npz"):
        with np.load(path, allow_pickle=False) as arrays:
            for name in sorted(set(arrays.files) - {"made_for"}):  # a hash of what it follows from, names included
                found[f"{path.name}/{name}"] = hashlib.sha256(arrays[name].tobytes()).hexdigest()
    return found


def remembered(revision: str | None, side: Path, name: str) -> dict[str, str]:
    """What `made` says; of a revision it is said from a file where it was made before."""
    file = side / f"{name}.json"
    if revision is not None and file.exists():
        return json.loads(file.read_text("utf-8"))
    found = made(side / "site", RUNS[name], side / "out" / name)
    file.write_text(json.dumps(found, indent=1), "utf-8")
    return found


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("revision", help="a revision of git")
    parser.add_argument("other", nargs="?", help="another one; default: the working tree")
    parser.add_argument("--only", help=f"runs, with commas: {', '.join(RUNS)}")
    parser.add_argument("--keep", type=Path, help="folder for what is made, gone on with if it is there")
    chosen = parser.parse_args()
    wanted = chosen.only.split(",") if chosen.only else list(RUNS)
    differing = 0
    with tempfile.TemporaryDirectory() as temporary:
        base = (chosen.keep or Path(temporary)).resolve()
        sides = []
        for revision in (chosen.revision, chosen.other):
            side = base / (revision or "working-tree")
            if revision is None and side.exists():
                shutil.rmtree(side)
            if not (side / "site").is_dir():
                installed(revision, side)
            sides.append((revision, side))
        for name in wanted:
            first, second = (remembered(revision, side, name) for revision, side in sides)
            different = sorted(key for key in first.keys() | second.keys() if first.get(key) != second.get(key))
            differing += len(different)
            failed = "exit code" in first
            print(f"{name}: {len(first)} files and arrays, {len(different)} differ {' '.join(different)}", flush=True)
            for (_, side), found in zip(sides, (first, second), strict=True):
                if "exit code" in found:
                    print(f"  {side.name}: exit code {found['exit code']}")
            differing += failed
    return 1 if differing else 0


if __name__ == "__main__":
    sys.exit(main())
