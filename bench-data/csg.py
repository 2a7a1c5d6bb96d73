#!/usr/bin/env python3
"""Times of Booleans and machining, and the same by Manifold where it is installed.

    bench-data/csg.py --program target/release/brickfield piles --a pile-1.stl --b pile-2.stl --cell 0.1mm
    bench-data/csg.py --program target/release/brickfield moves --count 10000
    bench-data/csg.py --program target/release/brickfield part pile-45m.brf cut.brf
    bench-data/csg.py --program target/release/brickfield forms --cell 0.1
    bench-data/csg.py --program target/release/brickfield voids --count 1000
    bench-data/csg.py --program target/release/brickfield points --count 1000000

Piles are those of `make-input pile --triangles 1000000 --seed 1 -o pile-1.stl`. Manifold is `pip install manifold3d`, MeshLib
`pip install meshlib`; points are compared with `pip install libigl`. Exit status 1 if any of them differs.
"""

import argparse
import csv
import json
import math
import os
import random
import resource
import struct
import subprocess
import sys
import tempfile
import time
from pathlib import Path


def run(*args):
    """Runs a command; its output, seconds of the wall and of processors, MiB of memory at most."""
    begun = time.time()
    process = subprocess.Popen([str(a) for a in args], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    out, err = process.communicate()
    seconds = time.time() - begun
    if process.returncode:
        sys.exit(f"{' '.join(map(str, args))}: {err}")
    return out, seconds


def told(name, seconds, more=""):
    load = os.getloadavg()[0]
    print(f"{name:34} {seconds:8.2f} s   load {load:4.1f}   {more}", flush=True)


# Triangles of a box; bits of a corner's number say which coordinates are the larger ones.
BOX = [
    triangle
    for a, b, c, d in ([0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6])
    for triangle in ((a, b, c), (a, c, d))
]


def write_stl(path, points, faces):
    """Binary STL of triangles of numbered points."""
    data = b" " * 80 + struct.pack("<I", len(faces))
    for face in faces:
        data += bytes(12) + b"".join(struct.pack("<3f", *points[v]) for v in face) + bytes(2)
    Path(path).write_bytes(data)


def cuboid(path, low, high):
    """A box as binary STL."""
    write_stl(path, [[high[a] if c >> a & 1 else low[a] for a in range(3)] for c in range(8)], BOX)


def piles(args, folder):
    """A minus B of two piles."""
    a, b, out = folder / "a.brf", folder / "b.brf", folder / "out.brf"
    told("build A", run(args.program, "build", args.a, "-o", a, "--cell", args.cell, "-q")[1])
    told("build B --like A", run(args.program, "build", args.b, "-o", b, "--like", a, "-q")[1])
    for option in ("--minus", "--plus", "--and"):
        text, seconds = run(args.program, "csg", a, option, b, "-o", out, "--json")
        found = json.loads(text)
        told(f"csg A {option} B", seconds, f"{found['leaves']} leaves, {found['hidden_walls']} hidden walls")
    told("mesh of the last", run(args.program, "mesh", out, "-o", folder / "out.stl", "-q")[1])
    try:
        import manifold3d
        import numpy as np
    except ImportError:
        print("Manifold is not installed")
        return meshlib(args)

    def beads(path):
        data = np.fromfile(path, dtype=np.uint8)[84:].reshape(-1, 50)[:, 12:48].copy().view("<f4").reshape(-1, 3, 3)
        # The pile's beads have 500 facets each.
        for n in range(0, len(data), 500):
            points, index = np.unique(data[n:n + 500].reshape(-1, 3), axis=0, return_inverse=True)
            mesh = manifold3d.Mesh(points.astype(np.float32), index.reshape(-1, 3).astype(np.uint32))
            yield manifold3d.Manifold(mesh)

    begun = time.time()
    both = []
    for path in (args.a, args.b):
        parts = list(beads(path))
        bad = sum(part.status() != manifold3d.Error.NoError for part in parts)
        united = manifold3d.Manifold.batch_boolean(parts, manifold3d.OpType.Add)
        # It is computed when it is asked for.
        triangles = united.num_tri()
        told(f"Manifold union of {len(parts)} beads", time.time() - begun,
             f"{triangles} triangles, {united.status()}, {bad} beads refused")
        both.append(united)
        begun = time.time()
    begun = time.time()
    left = both[0] - both[1]
    triangles = left.num_tri()
    told("Manifold A - B of the unions", time.time() - begun, f"{triangles} triangles, {left.status()}")
    meshlib(args)


def meshlib(args):
    """A minus B by MeshLib, as the files are."""
    try:
        from meshlib import mrmeshpy
    except ImportError:
        print("MeshLib is not installed")
        return
    begun = time.time()
    a, b = (mrmeshpy.loadMesh(str(path)) for path in (args.a, args.b))
    told("MeshLib reads both", time.time() - begun)
    begun = time.time()
    result = mrmeshpy.boolean(a, b, mrmeshpy.BooleanOperation.DifferenceAB)
    what = result.errorString if not result.valid() else f"{result.mesh.topology.numValidFaces()} triangles"
    told("MeshLib A - B", time.time() - begun, what)


def turned_boxes(path, count, rng):
    """Boxes of all sizes and turns, of which some lie within others, as binary STL. Returns corners and facets."""
    import numpy as np

    points, faces = [], []
    for n in range(count):
        turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        turn[:, 0] *= np.sign(np.linalg.det(turn))
        half = np.exp(rng.uniform(np.log(0.3), np.log(2.5), 3))
        corners = np.array([[half[a] * (1 if c >> a & 1 else -1) for a in range(3)] for c in range(8)])
        first = len(points)
        # The first two keep the others within their own box, so that the lattices of all agree.
        place = [-9.5, 9.5][n] * np.ones(3) if n < 2 else rng.uniform(-5, 5, 3)
        points.extend((corners if n > 1 else corners / abs(corners) / 10) @ turn.T + place)
        faces += [[first + v for v in triangle] for triangle in BOX]
    # As the file has them.
    points = np.array(points, np.float32)
    write_stl(path, points, faces)
    return points.astype(float), np.array(faces)


def points(args, folder):
    """Samples of three results at random places of the lattice, beside the sums over all facets of both inputs."""
    import igl
    import numpy as np

    rng = np.random.default_rng(args.seed)
    meshes = [turned_boxes(folder / f"{name}.stl", args.boxes, rng) for name in "ab"]
    a, b = folder / "a.brf", folder / "b.brf"
    run(args.program, "build", folder / "a.stl", "-o", a, "--depth", args.depth, "-q")
    run(args.program, "build", folder / "b.stl", "-o", b, "--like", a, "-q")
    root = json.loads(run(args.program, "info", a, "--json")[0])["root"]
    cells = 32 << int(args.depth)
    at = np.array(root["origin"]) + rng.integers(0, cells, (args.count, 3)) * (root["edge"] / cells)
    inside = [np.rint(igl.winding_number(v, f, at)) > 0 for v, f in meshes]
    truths = {"--minus": inside[0] & ~inside[1], "--plus": inside[0] | inside[1], "--and": inside[0] & inside[1]}
    table, wrong, out = folder / "points.csv", 0, folder / "out.brf"
    np.savetxt(table, at, fmt="%.17g", delimiter=",")
    for option, truth in truths.items():
        run(args.program, "csg", a, option, b, "-o", out, "-q")
        lines, seconds = run(args.program, "sample", out, "--points", table)
        w = np.array([float(line.rsplit(",", 1)[1]) for line in lines.splitlines()[1:]])
        # Places are rounded to 2^-15 of a cell, and lie between their sample and the next one.
        differ = int((abs(w - truth) > 1e-3).sum())
        wrong += differ
        told(f"sample A {option} B", seconds, f"{len(w)} points, {int(truth.sum())} inside, {differ} differ")
    sys.exit(wrong > 0)


def path_of(count):
    """A raster of so many short segments, a little bent so that none can be joined."""
    rows = max(1, round(math.sqrt(count / 10)))
    per_row = count // rows
    points = []
    for row in range(rows):
        y = 1 + 98 * row / max(1, rows - 1)
        steps = range(per_row + 1)
        xs = [1 + 98 * step / per_row for step in (steps if row % 2 == 0 else reversed(steps))]
        points += [(x, y + 0.02 * (n % 2)) for n, x in enumerate(xs)]
    return points


def cut(*command):
    """Runs `machine` with `--json`, and prints what it tells."""
    text, seconds = run(*command)
    found = json.loads(text)
    volume = f"{found['removed_volume']:.3f} ± {found['removed_volume_error']:.3f} mm³"
    phases = ", ".join(f"{name} {time:.2f}" for name, time in found["phases"])
    told(f"machine {found['moves']} moves", seconds, f"{found['leaves']} leaves, {volume}; {phases}")


def moves(args, folder):
    """So many moves of a ball of 1 mm over a plate, and a build of as many segments of beads as wide."""
    points = path_of(args.count)
    cuboid(folder / "plate.stl", (0, 0, 0), (100, 100, 2))
    program = ["G21 G90", f"G0 X{points[0][0]:.4f} Y{points[0][1]:.4f} Z10", "G1 Z1.75"]
    beads = ["; filament_diameter = 1.75", "G21", "G90", "M83", ";LAYER_CHANGE", ";Z:0.5", ";HEIGHT:0.5", ";TYPE:Perimeter",
             ";WIDTH:1", f"G1 X{points[0][0]:.4f} Y{points[0][1]:.4f} Z0.5 F600"]
    for x, y in points[1:]:
        program.append(f"G1 X{x:.4f} Y{y:.4f}")
        beads.append(f"G1 X{x:.4f} Y{y:.4f} E0.05")
    (folder / "p.nc").write_text("\n".join(program) + "\n")
    (folder / "p.gcode").write_text("\n".join(beads) + "\n")
    plate, out = folder / "plate.brf", folder / "out.brf"
    told("build of the plate", run(args.program, "build", folder / "plate.stl", "-o", plate, "--cell", args.cell, "-q")[1])
    told(f"build of {len(points) - 1} segments",
         run(args.program, "build", folder / "p.gcode", "-o", folder / "b.brf", "--cell", args.cell, "-q")[1])
    cut(args.program, "machine", plate, folder / "p.nc", "--tool", "ball:1mm", "-o", out, "--json")


def part(args, folder):
    """So many moves of a ball of 4 mm that take a millimetre off the top of a part, with the memory that this takes."""
    (x0, y0, _), (x1, y1, top) = json.loads(run(args.program, "info", "--json", args.store)[0])["bounds"]
    points = [(x0 + (x1 - x0) * x / 100, y0 + (y1 - y0) * y / 100) for x, y in path_of(args.count)]
    program = ["G21 G90", f"G0 X{points[0][0]:.4f} Y{points[0][1]:.4f} Z{top + 10:.4f}", f"G1 Z{top - 1:.4f}"]
    program += [f"G1 X{x:.4f} Y{y:.4f}" for x, y in points[1:]]
    (folder / "p.nc").write_text("\n".join(program) + "\n")
    cut(args.program, "machine", args.store, folder / "p.nc", "--tool", "ball:4mm", "-o", args.output, "--json",
        "--memory", args.memory)
    print(f"{resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024:.0f} MiB resident at most")


def forms(args, folder):
    """Removed volumes against closed forms: a block of 20 mm."""
    pi, cone = math.pi, math.tan(math.radians(59))

    def drilled(diameter, depth):
        radius = diameter / 2
        return pi * radius * radius * (depth - radius / cone * 2 / 3)

    def around_a_cone():
        """The side of a mill of 12 mm around a cone with radii of 6 mm at z = 0 and 3 at 20, by one arc that turns it."""
        lean, low = math.atan(3 / 20), -3
        away = 6 - low * 3 / 20 + 6 * math.cos(lean)
        start = f"X{10 + away!r} Y10 Z{low + 6 * math.sin(lean)!r}"
        return f"G0 X60 Y10 Z60\nG0 B{-math.degrees(lean)!r} Z-1\nG1 {start}\nG3 {start} I{-away!r} C360\n"

    half = 2.5 * math.sqrt(2)
    cases = [
        ("slot", "flat:6", "G0 X-10 Y10.03 Z25\nG0 Z16\nG1 X30\n", 480),
        ("slot at 45°", "flat:5", "G0 X-10 Y-10 Z16\nG1 X30 Y30\n", 4 * (400 - (20 - half) ** 2)),
        ("drilled hole", "drill:10", "G0 X9.7 Y10.1 Z30\nG81 Z8 R21\nG80\n", drilled(10, 12)),
        ("ball face", "ball:6", "G0 X-10 Y10.1 Z18\nG1 X30\n", 20 * (9 * math.acos(1 / 3) - math.sqrt(8))),
        ("bull face", "bull:8,2", "G0 X-10 Y10.1 Z15\nG1 X30\n", 20 * (40 - 8 * (1 - pi / 4))),
        ("chamfer", "chamfer:10,90", "G0 X-10 Y0 Z18\nG1 X30\n", 40),
        ("helix", "flat:6", "G0 X14 Y10 Z20\nG3 X14 Y10 I-4 Z17.5\nG3 X14 Y10 I-4 Z15\nG3 X14 Y10 I-4\n", pi * 240),
        ("cone, five axes", "flat:12", around_a_cone(), 8000 - pi * 20 / 3 * (36 + 18 + 9)),
        ("from the side", "flat:6", "G0 X-5 Y10.1 Z9.8 B-90\nG1 X7\n", pi * 63),
    ]
    cuboid(folder / "block.stl", (0, 0, 0), (20, 20, 20))
    block, program = folder / "block.brf", folder / "p.nc"
    run(args.program, "build", folder / "block.stl", "-o", block, "--cell", args.cell, "-q")
    for name, tool, text, truth in cases:
        program.write_text(text)
        out, seconds = run(args.program, "machine", block, program, "--tool", tool, "-o", folder / "o.brf", "--json")
        found = json.loads(out)
        volume, error = found["removed_volume"], found["removed_volume_error"]
        within = "within" if abs(volume - truth) <= error else "BEYOND"
        told(name, seconds, f"{volume:.4f} ± {error:.4f}, truth {truth:.4f}: {100 * (volume / truth - 1):+.4f} %, {within}")


def voids(args, folder):
    """Balls under a face cut: class and ligament against the formulas."""
    rng = random.Random(1)
    side = math.ceil(args.count ** (1 / 3))
    size = 4.0 * side
    cuboid(folder / "block.stl", (0, 0, 0), (size, size, size))
    balls = []
    for n in range(args.count):
        place = (n % side, n // side % side, n // side // side)
        radius = rng.uniform(0.8, 1.4)
        balls.append(([4 * c + 2 + rng.uniform(-1, 1) * (1.7 - radius) for c in place], radius))
    block, holed = folder / "block.brf", folder / "holed.brf"
    run(args.program, "build", folder / "block.stl", "-o", block, "--cell", args.cell, "-q")
    operands = []
    for (x, y, z), r in balls:
        operands += ["--minus", f"sphere {x!r},{y!r},{z!r},r{r!r}"]
    told(f"csg with {args.count} balls", run(args.program, "csg", block, *operands, "-o", holed, "-q")[1])
    cell, height = float(args.cell), size / 2 + 2.137
    (folder / "p.nc").write_text(f"G0 X{-size} Y{size / 2} Z{2 * size}\nG0 Z{height}\nG1 X{2 * size}\n")
    table = folder / "opened.csv"
    seconds = run(args.program, "machine", holed, folder / "p.nc", "--tool", f"flat:{2 * size}", "-o", folder / "o.brf",
                  "--voids", table, "-q")[1]
    rows, wrong, worst, counts = list(csv.DictReader(table.open())), 0, 0.0, {}
    for row in rows:
        at = [float(row[name]) for name in "xyz"]
        centre, radius = min(balls, key=lambda ball: sum((a - b) ** 2 for a, b in zip(ball[0], at)))
        top, bottom = centre[2] + radius, centre[2] - radius
        state = "untouched" if top < height else "consumed" if bottom > height else "opened"
        counts[state] = counts.get(state, 0) + 1
        wrong += row["state"] != state
        if state == "untouched" and row["ligament"]:
            worst = max(worst, abs(float(row["ligament"]) - (height - top)) / cell)
    told(f"machine --voids, {len(rows)} voids", seconds, f"{counts}, {wrong} wrong, ligaments within {worst:.4f} cells")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", default="target/release/brickfield")
    commands = parser.add_subparsers(dest="command", required=True)
    of_piles = commands.add_parser("piles")
    of_piles.add_argument("--a", required=True)
    of_piles.add_argument("--b", required=True)
    of_piles.add_argument("--cell", default="0.1mm")
    of_part = commands.add_parser("part")
    of_part.add_argument("store", type=Path)
    of_part.add_argument("output", type=Path)
    of_part.add_argument("--count", type=int, default=10000)
    of_part.add_argument("--memory", default="1GiB")
    of_moves = commands.add_parser("moves")
    of_moves.add_argument("--count", type=int, default=10000)
    of_moves.add_argument("--cell", default="0.1mm")
    commands.add_parser("forms").add_argument("--cell", default="0.1")
    of_voids = commands.add_parser("voids")
    of_voids.add_argument("--count", type=int, default=1000)
    of_voids.add_argument("--cell", default="0.2")
    of_points = commands.add_parser("points")
    of_points.add_argument("--count", type=int, default=1_000_000)
    of_points.add_argument("--boxes", type=int, default=60)
    of_points.add_argument("--depth", default="4")
    of_points.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        {"piles": piles, "moves": moves, "part": part, "forms": forms, "voids": voids, "points": points}[args.command](args, Path(folder))


if __name__ == "__main__":
    main()
