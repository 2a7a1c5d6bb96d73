"""Draws clover.png, the picture in the README, from what the program writes (needs NumPy and Matplotlib):

    brickfield build bench-data/stl/clover_beads.stl -o clover.brf --mesh clover.stl
    brickfield export clover.brf --level 4 -o clover.npy
    python3 bench-data/pictures/clover.py clover.stl clover.npy bench-data/pictures/clover.png
"""

import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import ListedColormap


def shaded(path, size=900):
    """The mesh from above at an angle, facets splatted with a depth test (they are smaller than a pixel)."""
    facets = np.fromfile(path, np.dtype([("n", "<f4", 3), ("v", "<f4", (3, 3)), ("a", "<u2")]), offset=84)
    centre, normal = facets["v"].mean(axis=1), facets["n"]
    a, e = np.radians(-60), np.radians(40)
    right = np.array([np.cos(a), -np.sin(a), 0])
    away = np.array([np.sin(a) * np.cos(e), np.cos(a) * np.cos(e), -np.sin(e)])
    up = np.cross(right, away)
    x, y, depth = centre @ right, centre @ up, centre @ away
    scale = (size - 20) / max(np.ptp(x), np.ptp(y))
    px = ((x - x.min()) * scale + 10).astype(int)
    py = ((y.max() - y) * scale + 10).astype(int)
    order = np.argsort(-depth)
    light = np.clip(normal @ -(away * 0.6 + right * 0.5 - up * 0.6), 0, 1) * 0.75 + 0.2
    image = np.ones((py.max() + 12, size, 3))
    image[py[order], px[order]] = light[order, None] * np.array([0.95, 0.62, 0.35])
    return image


def main(stl, npy, out):
    w = np.load(npy)
    layer = w[int(w.shape[0] * 0.5)]
    rows, columns = np.where(layer.any(axis=1))[0], np.where(layer.any(axis=0))[0]
    layer = layer[rows[0] - 8 : rows[-1] + 8, columns[0] - 8 : columns[-1] + 8]
    colours = ListedColormap(["#ffffff", "#9ecae1", "#3182bd", "#fd8d3c", "#a50f15"])
    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4.6), dpi=80)
    left.imshow(shaded(stl))
    left.set_title("mesh of the union", fontsize=10)
    drawn = right.imshow(layer, cmap=colours, vmin=-0.5, vmax=4.5, origin="lower", interpolation="nearest")
    right.set_title("winding number in one layer", fontsize=10)
    for axes in (left, right):
        axes.set_axis_off()
    figure.colorbar(drawn, ax=right, ticks=range(5), shrink=0.8, label="beads that cover a sample")
    figure.tight_layout()
    figure.savefig(out)


main(*sys.argv[1:])
