#!/usr/bin/env python3
"""Plots porosity, and material fed beyond the union, by layer.

    brickfield build part.gcode -o part.brf --identity
    brickfield layers part.brf -o layers.csv
    python3 examples/porosity_by_layer.py layers.csv porosity.png

Needs matplotlib.
"""

import csv
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt


def main():
    if len(sys.argv) != 3:
        sys.exit("usage: porosity_by_layer.py LAYERS.csv OUT.png")
    table, picture = sys.argv[1:]
    with open(table, newline="") as file:
        rows = list(csv.DictReader(file))
    if not rows:
        sys.exit(f"{table}: the table has no rows")

    def column(name):
        return [float(row[name]) if row[name] else None for row in rows]

    height = [(low + high) / 2 for low, high in zip(column("z_bottom"), column("z_top"))]
    figure, (left, right) = plt.subplots(1, 2, sharey=True, figsize=(8, 5))
    left.plot([100 * p for p in column("porosity")], height, marker=".")
    left.set_xlabel("porosity, %")
    left.set_ylabel("height")
    beyond = [(b, f, z) for b, f, z in zip(column("fed_minus_union"), column("fed_volume"), height) if f]
    right.plot([100 * b / f for b, f, _ in beyond], [z for _, _, z in beyond], marker=".", color="tab:orange")
    right.set_xlabel("fed beyond the union, % of what is fed")
    if not beyond:
        right.text(0.5, 0.5, "the table does not tell\nwhat was fed", ha="center", transform=right.transAxes)
    figure.tight_layout()
    figure.savefig(picture, dpi=120)


if __name__ == "__main__":
    main()
