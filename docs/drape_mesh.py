"""Does a drape coefficient hang on the distance of key points? Discs of every named cloth, by that distance.

    python docs/drape_mesh.py                                  # all cloths at 7.5, 5 and 3.5 mm
    python docs/drape_mesh.py --cloths poplin,denim-12oz --spacings 7.5,5 --discs 12,8

What is draped is kept beside this file in drape_mesh.csv, row by row as it is done; `python docs/fabrics.py` shows it.
CPU time of each row goes to standard output.
"""

import argparse
import csv
from math import sqrt
from pathlib import Path
from time import process_time

from taichi_cloth.ground import runtime
from taichi_cloth.mechanics.presets import TRADE, preset_properties, woven_material
from taichi_cloth.scenes.fabric.drapemeter import drape

ROWS = Path(__file__).with_suffix(".csv")
HEAD: tuple[str, ...] = ("cloth", "spacing_mm", "coefficient_pct", "error_pct", "discs")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cloths", default=",".join(TRADE), help="by name; default: all that there are")
    parser.add_argument("--spacings", default="7.5,5,3.5", help="of key points [mm]; default: %(default)s")
    parser.add_argument("--discs", default="12,8,6", help="for each spacing; default: %(default)s")
    given = parser.parse_args()
    spacings, discs = given.spacings.split(","), [int(word) for word in given.discs.split(",")]
    runtime.start("cpu", threads=1)
    for name in given.cloths.split(","):
        material = woven_material(preset_properties(name))
        for spacing, count in zip(spacings, discs, strict=True):
            begin = process_time()
            found = drape(material, spacing=1e-3 * float(spacing), specimens=count)
            error = float(found.coefficients.std(ddof=1)) / sqrt(count)
            keep(dict(zip(HEAD, (name, spacing, f"{found.coefficient:.1f}", f"{error:.1f}", str(count)), strict=True)))
            mean, took = f"{found.coefficient:.1f} ± {error:.1f} % ({count})", process_time() - begin
            print(f"{name} {spacing} mm: {mean}, {1e3 * found.speed:.1f} mm/s, {took:.0f} s", flush=True)


def keep(row: dict[str, str]) -> None:
    """In ROWS, instead of what stands there of that cloth and spacing."""
    known = []
    if ROWS.exists():
        with ROWS.open(encoding="utf-8", newline="") as file:
            known = list(csv.DictReader(file))
    others = [one for one in known if (one["cloth"], one["spacing_mm"]) != (row["cloth"], row["spacing_mm"])]
    order = list(TRADE)
    rows = sorted([*others, row], key=lambda one: (order.index(one["cloth"]), -float(one["spacing_mm"])))
    with ROWS.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, HEAD, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


if __name__ == "__main__":
    main()
