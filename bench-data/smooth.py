#!/usr/bin/env python3
"""Crossings where w is smooth, beside the straight line between the same samples, and errors of w beside their bound.

    python3 bench-data/smooth.py --program target/release/brickfield FOLDER
    python3 bench-data/smooth.py --program target/release/brickfield FOLDER --mesh pile.stl   # the bound alone

Needs numpy and igl (PyPI's `libigl`). Prints the tables of report/smooth-crossings.md. Exit status 1 if an error is above
the bound that was asked for.

Vertices of `mesh --method mc` on lattice edges are the crossings of the store. Those of straight lines come from the
store's samples at both ends of the same edges.
"""

import argparse
import json
import os
import struct
import subprocess
import sys

import igl
import numpy as np

SPHERE, TORUS = 10.0, (7.0, 3.0)
DEPTHS = (2, 3, 4)
DECADES = [0, 1e-9, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, np.inf]


def from_sphere(p):
    return np.linalg.norm(p, axis=1) - SPHERE


def from_torus(p):
    return np.hypot(np.hypot(p[:, 0], p[:, 1]) - TORUS[0], p[:, 2]) - TORUS[1]


def sphere_cloud(count, random):
    normals = random.normal(size=(count, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    return SPHERE * normals, normals


def torus_cloud(count, random):
    """Points evenly by area: of those at random angles, as many as the circle there is long."""
    u, v, keep = random.uniform(size=(3, 4 * count))
    u, v = 2 * np.pi * u, 2 * np.pi * v
    rho = TORUS[0] + TORUS[1] * np.cos(v)
    u, v, rho = (x[keep * sum(TORUS) < rho][:count] for x in (u, v, rho))
    points = np.stack([rho * np.cos(u), rho * np.sin(u), TORUS[1] * np.sin(v)], 1)
    return points, np.stack([np.cos(v) * np.cos(u), np.cos(v) * np.sin(u), np.sin(v)], 1)


def sphere_mesh(level=6):
    """An icosahedron, every facet divided in four again and again, outward."""
    g = (1 + 5 ** 0.5) / 2
    corners = [(0, s, t * g) for s in (1, -1) for t in (1, -1)]
    vertices = np.array([np.roll(c, k) for c in corners for k in range(3)], float)
    n = range(12)
    apart = lambda a, b: abs(np.linalg.norm(vertices[a] - vertices[b]) - 2) < 1e-9
    faces = [(a, b, c) for a in n for b in n for c in n if a < b < c and apart(a, b) and apart(b, c) and apart(a, c)]
    soup = vertices[np.array(faces)]
    turned = np.linalg.det(soup) < 0
    soup[turned] = soup[turned][:, ::-1]
    for _ in range(level):
        a, b, c = soup[:, 0], soup[:, 1], soup[:, 2]
        ab, bc, ca = a + b, b + c, c + a
        soup = np.concatenate([np.stack(t, 1) for t in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))])
        soup /= np.linalg.norm(soup, axis=2, keepdims=True)
    return (SPHERE * soup).astype("<f4")


def torus_mesh(around=480, across=160):
    angles = lambda n: np.arange(n) * 2 * np.pi / n
    u, v = np.meshgrid(angles(around), angles(across), indexing="ij")
    rho = TORUS[0] + TORUS[1] * np.cos(v)
    p = np.stack([rho * np.cos(u), rho * np.sin(u), TORUS[1] * np.sin(v)], -1).astype("<f4")
    q, r, s = np.roll(p, -1, 0), np.roll(p, (-1, -1), (0, 1)), np.roll(p, -1, 1)
    return np.concatenate([np.stack(t, -2).reshape(-1, 3, 3) for t in ((p, q, r), (p, r, s))])


def write_stl(path, soup):
    record = np.zeros(len(soup), dtype=[("n", "<f4", 3), ("v", "<f4", (3, 3)), ("a", "<u2")])
    record["v"] = soup
    with open(path, "wb") as file:
        file.write(b"\0" * 80 + struct.pack("<I", len(soup)) + record.tobytes())


def read_stl(path):
    record = np.dtype([("n", "<f4", 3), ("v", "<f4", (3, 3)), ("a", "<u2")])
    return np.fromfile(path, record, offset=84)["v"].copy()


def indexed(soup):
    vertices = np.ascontiguousarray(soup.reshape(-1, 3), float)
    return vertices, np.arange(len(vertices)).reshape(-1, 3)


def solid_angles(soup, places):
    """The sum of the solid angles of facets over 4π (Van Oosterom & Strackee 1983), in parts to save memory."""
    out = np.zeros(len(places))
    dot = lambda x, y: (x * y).sum(2)
    for part in np.array_split(np.arange(len(places)), max(1, len(places) // 4096)):
        many = max(1, len(soup) * len(part) // 262_144)
        for facets in np.array_split(soup.astype(float), many):
            a, b, c = (facets[None, :, k] - places[part, None] for k in range(3))
            la, lb, lc = (np.linalg.norm(x, axis=2) for x in (a, b, c))
            below = la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb
            out[part] += np.arctan2(dot(a, np.cross(b, c)), below).sum(1) / (2 * np.pi)
    return out


class Program:
    def __init__(self, program, folder, error=None):
        self.program, self.folder = program, folder
        self.error = ["--gwn-error", error] if error else []

    def path(self, name):
        return os.path.join(self.folder, name)

    def run(self, *words):
        done = subprocess.run([self.program, *words], check=True, stdout=subprocess.PIPE, text=True)
        return done.stdout

    def winding(self, source, places, *words):
        np.savetxt(self.path("places.csv"), places, fmt="%.17g", delimiter=",")
        text = self.run("winding", source, "--points", self.path("places.csv"), "-q", *words)
        return np.array([float(line.rsplit(",", 1)[1]) for line in text.splitlines()[1:]])

    def samples(self, source, *words):
        """The finest samples of a store, [z, y, x], where the first lies, and their spacing."""
        store, array = self.path("smooth.brf"), self.path("smooth.npy")
        self.run("build", source, "-o", store, "-q", *words)
        self.run("export", store, "-o", array, "--dtype", "f4", "-q")
        with open(self.path("smooth.json")) as file:
            told = json.load(file)
        return np.load(array, mmap_mode="r"), np.array(told["origin"]), told["spacing"]

    def crossings(self, source, depth):
        """Both ends of edges, the samples there, and how far along the store's crossing lies, from 0 to 1."""
        w, origin, step = self.samples(source, "--depth", str(depth), *self.error)
        self.run("mesh", self.path("smooth.brf"), "-o", self.path("smooth.ply"), "--method", "mc", "--double", "-q")
        place = (vertices(self.path("smooth.ply")) - origin) / step
        off = np.abs(place - np.rint(place))
        axis = off.argmax(1)
        place = place[np.sort(off, axis=1)[:, 1] < 1e-4]
        axis = axis[np.sort(off, axis=1)[:, 1] < 1e-4]
        rows = np.arange(len(place))
        low = np.rint(place).astype(int)
        low[rows, axis] = np.floor(place[rows, axis])
        high = low.copy()
        high[rows, axis] += 1
        at = lambda i: np.asarray(w[i[:, 2], i[:, 1], i[:, 0]], float)
        first, last = at(low), at(high)
        sound = (first < 0.5) != (last < 0.5)
        root = place[rows, axis] - low[rows, axis]
        ends = origin + step * low, origin + step * high
        return [x[sound] for x in (*ends, first, last, root)], step, len(rows) - sound.sum()


def vertices(path):
    with open(path, "rb") as file:
        data = file.read()
    start = data.index(b"end_header\n") + 11
    head = data[:start].decode()
    count = int(head.split("element vertex ")[1].split()[0])
    kind = "<f8" if "property double x" in head else "<f4"
    return np.frombuffer(data, kind, count * 3, start).reshape(-1, 3).astype(float)


def along(low, high, t):
    return low + t[:, None] * (high - low)


def bisected(value, low, high, steps=40):
    """Where a function changes its sign between two places, as shares of the way."""
    left, right = np.zeros(len(low)), np.ones(len(low))
    sign = value(low) < 0
    for _ in range(steps):
        middle = (left + right) / 2
        same = (value(along(low, high, middle)) < 0) == sign
        left, right = np.where(same, middle, left), np.where(same, right, middle)
    return (left + right) / 2


def root_of(value, low, high, left_value, right_value, steps=8):
    """The same for a smooth function, by regula falsi in its Illinois form, from its values at both ends."""
    left, right, side = np.zeros(len(low)), np.ones(len(low)), np.zeros(len(low))
    for _ in range(steps):
        middle = (left * right_value - right * left_value) / (right_value - left_value)
        found = value(along(low, high, middle))
        is_left = (found < 0) == (left_value < 0)
        right_value = np.where(is_left, right_value * np.where(side > 0, 0.5, 1), found)
        left_value = np.where(is_left, found, left_value * np.where(side < 0, 0.5, 1))
        left, right = np.where(is_left, middle, left), np.where(is_left, right, middle)
        side = np.where(is_left, 1, -1)
    return middle


def row(name, depth, step, count, smooth, line):
    """A line of a table: rms and largest in cells, of crossings and of straight lines, and rms in units."""
    rms = lambda x: np.sqrt((x ** 2).mean())
    cells = lambda x: f"{rms(x) / step:.5f}, {np.abs(x).max() / step:.4f} | {rms(x):.6f}, {np.abs(x).max():.5f}"
    print(f"| {name} | {depth} | {step:.4f} | {count} | {cells(smooth)} | {cells(line)} | {rms(line) / rms(smooth):.2f} |",
          flush=True)


HEAD = """
| input | depth | cell, mm | edges | crossing: rms, largest, cells | mm | line: rms, largest, cells | mm | line / crossing |
|---|---|---|---|---|---|---|---|---|"""


def compare(program, source, depth, distance, groups, name, judged=1000):
    """Rows against the true surface, and rows against the root of the sum itself on some of the edges."""
    (low, high, first, last, root), step, dropped = program.crossings(source, depth)
    line = (0.5 - first) / (last - first)
    if dropped:
        print(f"({dropped} vertices of {name}, depth {depth}, lie on no edge with a change of sign)")
    truth, own = [], []
    for label, chosen, to_surface in groups(low, high, root):
        if not chosen.any():
            continue
        a, b, r, l = low[chosen], high[chosen], root[chosen], line[chosen]
        if to_surface:
            truth.append((f"{name}, {label}", depth, step, len(a), distance(along(a, b, r)), distance(along(a, b, l))))
        if label == "at facets":
            continue
        some = np.random.default_rng(1).permutation(len(a))[:judged]
        value = lambda places: program.winding(source, places, "--brute") - 0.5
        at_low, at_high = value(a[some]), value(b[some])
        changes = at_low * at_high < 0  # a sample may be rounded to 0.5 itself, or past it
        some, at_low, at_high = some[changes], at_low[changes], at_high[changes]
        true = root_of(value, a[some], b[some], at_low, at_high)
        own.append((f"{name}, {label}", depth, step, len(some), (r[some] - true) * step, (l[some] - true) * step))
    return truth, own


def lost_or_kept(closed, lost, distance, hole_is_true):
    """Edges by the facet of the closed mesh that they meet: kept, or lost."""
    corners, faces = indexed(closed)

    def groups(low, high, root):
        true = along(low, high, np.where((distance(low) < 0) != (distance(high) < 0), bisected(distance, low, high), root))
        _, facet, _ = igl.point_mesh_squared_distance(true, corners, faces)
        hole = lost[np.asarray(facet).ravel()]
        return [("at facets", ~hole, True), ("in holes", hole, hole_is_true)]

    return groups


def crossings(program, count):
    random = np.random.default_rng(5)
    jobs = []
    for name, make, distance in (("sphere", sphere_cloud, from_sphere), ("torus", torus_cloud, from_torus)):
        source = program.path(f"{name}.xyz")
        np.savetxt(source, np.hstack(make(count, random)), fmt="%.9g")
        everywhere = lambda low, high, root: [("all edges", np.ones(len(low), bool), True)]
        jobs.append((f"{name} cloud", source, distance, everywhere))
    for name, make, distance in (("sphere", sphere_mesh, from_sphere), ("torus", torus_mesh, from_torus)):
        closed = make()
        one = np.zeros(len(closed), bool)
        one[random.permutation(len(closed))[:len(closed) // 100]] = True
        cap = closed[:, :, 2].min(1) > 8 if name == "sphere" else closed[:, :, 0].min(1) > 8
        for how, lost, is_true in (("less 1 %", one, True), ("less a cap", cap, False)):
            source = program.path(f"{name}-{how.split()[-2] if is_true else 'cap'}.stl")
            write_stl(source, closed[~lost])
            print(f"{name} {how}: {len(closed)} facets, {lost.sum()} lost")
            jobs.append((f"{name} {how}", source, distance, lost_or_kept(closed, lost, distance, is_true)))
    tables = [compare(program, source, depth, distance, groups, name)
              for name, source, distance, groups in jobs for depth in DEPTHS]
    for which, title in ((0, "Distance from the true surface"), (1, "Distance along the edge from the root of the whole sum")):
        print(f"\n{title}{HEAD}")
        for rows in tables:
            for numbers in rows[which]:
                row(*numbers)


class Lattice:
    """Where `build` and `winding` snap facets, to even units, and samples, to odd ones (docs/design/lattice.md)."""

    def __init__(self, root):
        self.origin, self.unit = np.array(root["origin"]), root["edge"] / 2 ** 24

    def facets(self, soup):
        return self.origin + 2 * self.unit * np.floor((soup - self.origin) / (2 * self.unit) + 0.5)

    def places(self, places):
        return self.origin + self.unit * (2 * np.floor((places - self.origin) / (2 * self.unit)) + 1)


def exact(closed, lost, places, found):
    """w of what is left: how often the closed soup goes around places, less the solid angles of the lost facets.

    The first is libigl's fast sum, rounded. Where that is not near an integer, or half away from what was found, all
    solid angles are added up."""
    corners, faces = indexed(closed)
    w = np.asarray(igl.fast_winding_number(corners, faces, places)).ravel()
    angles = solid_angles(closed[lost], places)
    unsure = (np.abs(w - np.rint(w)) > 0.15) | (np.abs(np.rint(w) - angles - found) > 0.5)
    unsure[:10] = True
    w[unsure] = solid_angles(closed, places[unsure])
    assert np.abs(w - np.rint(w))[unsure].max() < 1e-3, "the mesh is not closed"
    return np.rint(w) - angles


def places_about(closed, lost, count, random):
    """Half of the places anywhere in the box, half near lost facets, from a hundredth of their size to some sizes."""
    low, high = closed.reshape(-1, 3).min(0), closed.reshape(-1, 3).max(0)
    anywhere = random.uniform(low, high, (count // 2, 3))
    facet = closed[lost][random.integers(lost.sum(), size=count - count // 2)].astype(float)
    share = random.dirichlet((1, 1, 1), len(facet))
    size = np.linalg.norm(facet[:, 1] - facet[:, 0], axis=1)[:, None]
    shift = random.normal(size=(len(facet), 3)) * size * 10 ** random.uniform(-2, 0.7, (len(facet), 1))
    return np.concatenate([anywhere, (share[:, :, None] * facet).sum(1) + shift])


def nearest_samples(shape, origin, step, places):
    index = np.clip(np.rint((places - origin) / step).astype(int), 0, np.array(shape[::-1]) - 1)
    return np.unique(index, axis=0)


def bounds(program, meshes, count=100_000):
    """Histograms of errors; whether one is above its bound."""
    random, broken = np.random.default_rng(7), False
    print("\n| input | asked of | bound | places | " + " | ".join(f"≥ {x:g}" if x else "less" for x in DECADES[-2::-1])
          + " | worst | bound / worst |")
    print("|---" * (len(DECADES) + 5) + "|")
    for name, closed in meshes:
        for k in (1, 100):
            lost = np.zeros(len(closed), bool)
            lost[random.permutation(len(closed))[:k]] = True
            source = program.path("lost.stl")
            write_stl(source, closed[~lost])
            w, origin, step = program.samples(source, "--depth", "3", "--gwn-error", "0.001")
            lattice = Lattice(json.loads(program.run("info", program.path("smooth.brf"), "--json"))["root"])
            places = lattice.places(places_about(closed, lost, count, random))
            index = nearest_samples(w.shape, origin, step, places)
            jobs = [("winding", bound, places, program.winding(source, places, "--gwn-error", str(bound)))
                    for bound in (1e-2, 1e-3, 1e-5)]
            jobs.append(("store", 1e-3, origin + step * index, w[index[:, 2], index[:, 1], index[:, 0]].astype(float)))
            snapped, truth = lattice.facets(closed), None
            for what, bound, at, found in jobs:
                truth = exact(snapped, lost, at, found) if truth is None or what == "store" else truth
                errors = np.abs(found - truth)
                shares = np.histogram(errors, DECADES)[0][::-1]
                worst = errors.max()
                broken |= bool(worst > bound)
                print(f"| {name} less {k} | {what} | {bound:g} | {len(at)} | " + " | ".join(str(x) for x in shares)
                      + f" | {worst:.2e} | {bound / max(worst, 1e-300):.1f} |", flush=True)
    return int(broken)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--program", default="target/release/brickfield")
    parser.add_argument("--points", type=int, default=50_000)
    parser.add_argument("--gwn-error", help="the error of the stores of crossings [default: that of the program]")
    parser.add_argument("--mesh", help="a closed binary STL for the bound, which then is all that is measured")
    parser.add_argument("folder")
    args = parser.parse_args()
    os.makedirs(args.folder, exist_ok=True)
    program = Program(args.program, args.folder, args.gwn_error)
    if args.mesh:
        return bounds(program, [(os.path.splitext(os.path.basename(args.mesh))[0], read_stl(args.mesh))])
    crossings(program, args.points)
    return bounds(program, [("sphere", sphere_mesh()), ("torus", torus_mesh())])


if __name__ == "__main__":
    sys.exit(main())
