#!/usr/bin/env python3
"""A torus of few ellipses: the part, and a judge of what `brickfield splats --number` makes of it.

    ellipses.py part TORUS.stl [--tube 24]
    ellipses.py judge FEW.ply [--tube 24] [--picture PICTURE.png]

The torus lies around z, with a ring of radius 60 and a tube of radius 24. The judge knows its closed form: how far points of
the ellipses are from it, how far its points are from the ellipses, and whether an ellipse lies over each of them. Shares are
those of the diameter and of the diagonal of the box. The picture has the rim of every ellipse. Needs NumPy, and Pillow for
the picture (pip)."""

import argparse
import sys

import numpy

RING = 60.0
SIDES = (3072, 1536)


def place(tube, around, across):
    ring = RING + tube * numpy.cos(across)
    return numpy.stack([ring * numpy.cos(around), ring * numpy.sin(around), tube * numpy.sin(across) + 0 * around], -1)


def part(path, tube):
    """A binary STL of two triangles a cell, whose vertices lie on the torus."""
    around, across = [numpy.arange(n + 1) * (2 * numpy.pi / n) for n in SIDES]
    around[-1], across[-1] = 0, 0
    grid = place(tube, around[:, None], across[None, :]).astype("<f4")
    a, b, c, d = grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]
    corners = numpy.concatenate([numpy.stack([a, b, c], 2).reshape(-1, 9), numpy.stack([a, c, d], 2).reshape(-1, 9)])
    facets = numpy.zeros(len(corners), dtype=[("n", "<f4", 3), ("v", "<f4", 9), ("a", "<u2")])
    facets["v"] = corners
    with open(path, "wb") as file:
        file.write(b"torus".ljust(80) + numpy.uint32(len(facets)).tobytes() + facets.tobytes())


def read(path):
    """Centres, axes and radii: Gaussians have half of them as deviations."""
    data = open(path, "rb").read()
    end = data.index(b"end_header\n") + 11
    rows = numpy.frombuffer(data[end:], "<f4").reshape(-1, 14).astype(float)
    w, x, y, z = rows[:, 10:].T
    u = numpy.stack([1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)], 1)
    v = numpy.stack([2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)], 1)
    return rows[:, :3], u, v, 2 * numpy.exp(rows[:, 7:9])


def judge(path, tube, picture):
    centres, u, v, radii = read(path)
    normals = numpy.cross(u, v)
    # From the ellipses to the torus.
    turn, share = numpy.meshgrid(numpy.linspace(0, 2 * numpy.pi, 97), numpy.linspace(0, 1, 25))
    x, y = (share * numpy.cos(turn)).ravel(), (share * numpy.sin(turn)).ravel()
    points = centres[:, None] + (x[:, None] * radii[:, None, :1]) * u[:, None] + (y[:, None] * radii[:, None, 1:]) * v[:, None]
    off = abs(numpy.hypot(numpy.hypot(points[..., 0], points[..., 1]) - RING, points[..., 2]) - tube).max()
    # From the torus to the ellipses.
    around, across = [numpy.arange(n) * (2 * numpy.pi / n) for n in (1500, 750)]
    torus = place(tube, around[:, None], across[None, :]).reshape(-1, 3)
    nearest, is_over = numpy.full(len(torus), numpy.inf), numpy.zeros(len(torus), bool)
    for centre, a, b, n, (p, q) in zip(centres, u, v, normals, radii):
        some = numpy.nonzero(((torus - centre) ** 2).sum(1) < (1.5 * max(p, q)) ** 2)[0]
        delta = torus[some] - centre
        along, over = numpy.stack([delta @ a, delta @ b], 1), delta @ n
        scale = numpy.hypot(along[:, 0] / p, along[:, 1] / q)
        # Along the line to the centre the rim is nearer than that, or as near.
        beyond = numpy.hypot(*along.T) * (1 - 1 / numpy.maximum(scale, 1))
        nearest[some] = numpy.minimum(nearest[some], numpy.hypot(beyond, over))
        is_over[some] |= (scale <= 1) & (abs(over) < 0.05 * tube)
    diameter = 2 * (RING + tube)
    diagonal = (2 * diameter**2 + (2 * tube) ** 2) ** 0.5
    worst = max(off, nearest.max())
    print(f"{len(centres)} ellipses: {off:.4f} from them to the torus, {nearest.max():.4f} from the torus to them;")
    print(f"{worst / diameter:.4%} of the diameter, {worst / diagonal:.4%} of the diagonal; {(~is_over).mean():.4%} of the torus not under one")
    if picture:
        draw(picture, tube, (centres, u, v, normals, radii))
    if not is_over.mean() > 0.999:
        sys.exit("the torus is not covered")


def draw(path, tube, ellipses):
    """Where rays meet the nearest ellipse, shaded; rims are dark."""
    from PIL import Image

    width, height, rays = 1000, 640, 2
    azimuth, elevation = numpy.radians([-60, 40])
    away = -numpy.array([numpy.cos(elevation) * numpy.cos(azimuth), numpy.cos(elevation) * numpy.sin(azimuth), numpy.sin(elevation)])
    right = numpy.cross(away, [0, 0, 1])
    right /= numpy.linalg.norm(right)
    down = numpy.cross(away, right)
    pixel = 2.1 * (RING + tube) / width / rays
    shape = (height * rays, width * rays)
    depth, grey = numpy.full(shape, numpy.inf), numpy.full(shape, 255.0)
    for centre, u, v, normal, radii in zip(*ellipses):
        cosine = normal @ away
        if cosine >= 0:
            continue
        column, row = centre @ right / pixel + shape[1] / 2, centre @ down / pixel + shape[0] / 2
        reach = max(radii) / pixel + 1
        columns = numpy.arange(max(int(column - reach), 0), min(int(column + reach) + 2, shape[1]))
        rows = numpy.arange(max(int(row - reach), 0), min(int(row + reach) + 2, shape[0]))
        across = (columns + 0.5 - column)[None, :, None] * right * pixel + (rows + 0.5 - row)[:, None, None] * down * pixel
        along = -(across @ normal) / cosine
        place_ = across + along[..., None] * away
        share = numpy.hypot(place_ @ u / radii[0], place_ @ v / radii[1])
        along = along + centre @ away
        window = numpy.ix_(rows, columns)
        is_seen = (share <= 1) & (along < depth[window])
        light = 70 + 170 * abs(cosine) ** 0.8
        depth[window] = numpy.where(is_seen, along, depth[window])
        rim = 1 - 1.6 * pixel / min(radii)
        grey[window] = numpy.where(is_seen, numpy.where(share > rim, 0.55 * light, light), grey[window])
    small = grey.reshape(height, rays, width, rays).mean((1, 3))
    Image.fromarray(small.round().astype("uint8")).save(path, optimize=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=["part", "judge"])
    parser.add_argument("file")
    parser.add_argument("--tube", type=float, default=24)
    parser.add_argument("--picture")
    args = parser.parse_args()
    part(args.file, args.tube) if args.what == "part" else judge(args.file, args.tube, args.picture)


main()
