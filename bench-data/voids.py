#!/usr/bin/env python3
"""Figures of `brickfield voids` and `overlap` against closed forms and against cc3d.

    python3 -m venv venv && venv/bin/pip install numpy connected-components-3d
    venv/bin/python bench-data/voids.py --program target/release/brickfield shapes --each 500
    ... partition --axis 256 | ladder | leaks --each 200 | overlap

Each prints a table; exit status 1 if something that must hold does not. Seeds are fixed.
"""

import argparse
import json
import math
import multiprocessing
import os
import pathlib
import resource
import subprocess
import sys
import tempfile
import time

import numpy as np

HERE = pathlib.Path(__file__).resolve().parent


def run(program, *arguments):
    """The program's standard output; its errors end this one."""
    done = subprocess.run([program, *map(str, arguments)], capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"{' '.join(map(str, arguments))}: {done.stderr.strip()}")
    return done.stdout


def voids(program, store, folder, *options):
    out = folder / "voids.json"
    began = time.time()
    run(program, "voids", store, "-o", out, "-q", *options)
    return json.loads(out.read_text()), time.time() - began


# Shapes: triangles as arrays of n x 3 x 3, counter-clockwise seen from outside.

def box(low, high):
    corners = np.array([[(low, high)[i >> a & 1][a] for a in range(3)] for i in range(8)], float)
    quads = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    return np.array([corners[[a, b, c]] for q in quads for a, b, c in [(q[0], q[1], q[2]), (q[0], q[2], q[3])]])


def ball(detail):
    """Unit ball: an octahedron whose faces are divided `detail` times."""
    axes = np.vstack([np.eye(3), -np.eye(3)])
    faces = [[axes[i] for i in f] for f in
             [(0, 1, 2), (1, 3, 2), (3, 4, 2), (4, 0, 2), (1, 0, 5), (3, 1, 5), (4, 3, 5), (0, 4, 5)]]
    faces = np.array(faces)
    for _ in range(detail):
        a, b, c = faces[:, 0], faces[:, 1], faces[:, 2]
        ab, bc, ca = ((p + q) / np.linalg.norm(p + q, axis=1)[:, None] for p, q in ((a, b), (b, c), (c, a)))
        faces = np.concatenate([np.stack(t, 1) for t in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))])
    return faces


def capsule(detail, half):
    """A ball of radius 1 pulled apart along x by `half` both ways: the points with x > 0 that way, the others the other."""
    faces = ball(detail)
    middle = faces.mean(1)[:, 0]
    # Corners on the equator belong to both halves, and are joined by a band.
    moved = faces + np.where(middle > 0, half, -half)[:, None, None] * np.array([1.0, 0, 0])
    edge = faces[middle > 0]
    band = []
    for triangle in edge:
        for n in range(3):
            p, q = triangle[n], triangle[(n + 1) % 3]
            if abs(p[0]) < 1e-12 and abs(q[0]) < 1e-12:
                x = np.array([half, 0, 0])
                # The other side of this edge.
                band += [[q + x, p + x, p - x], [q + x, p - x, q - x]]
    return np.concatenate([moved, np.array(band)])


def turned(random):
    q = random.normal(size=4)
    w, x, y, z = q / np.linalg.norm(q)
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                     [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                     [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])


def measures(triangles):
    a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    cross = np.cross(b - a, c - a)
    return np.einsum("ij,ij->", a, cross) / 6, np.linalg.norm(cross, axis=1).sum() / 2


def write_stl(path, parts):
    triangles = np.concatenate(parts).astype("<f4")
    record = np.zeros(len(triangles), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("tag", "<u2")])
    record["corners"] = triangles
    with open(path, "wb") as file:
        file.write(b"\0" * 80 + np.uint32(len(triangles)).tobytes())
        record.tofile(file)


def flipped(triangles):
    return triangles[:, ::-1]


def shapes(args, folder):
    """Balls, cubes and capsules of 1 to 16 cells, any way round, cut out of a block."""
    random = np.random.default_rng(1)
    count = 3 * args.each
    side = math.ceil(count ** (1 / 3))
    pitch = 44.0
    parts, truth = [box([0] * 3, [side * pitch] * 3)], []
    for n in range(count):
        kind = ("ball", "cube", "capsule")[n % 3]
        radius = math.exp(random.uniform(0, math.log(16)))
        site = np.array([n % side, n // side % side, n // side // side]) * pitch + pitch / 2
        if kind == "ball":
            shape, size = ball(5 if radius > 5 else 4), radius
        elif kind == "cube":
            shape, size = box([-1] * 3, [1] * 3), radius / math.sqrt(3) * 1.3
        else:
            half = random.uniform(0.2, 1.0)
            shape, size = capsule(4, half), radius / (1 + half)
        shape = shape @ turned(random).T * size + site + random.uniform(-1, 1, 3)
        # What is written, in 32 bits.
        shape = shape.astype("f4").astype(float)
        volume, area = measures(shape - site)
        truth.append((kind, size, shape.mean((0, 1)), volume, area))
        parts.append(flipped(shape))
    stl, store = folder / "shapes.stl", folder / "shapes.brf"
    write_stl(stl, parts)
    run(args.program, "build", stl, "-o", store, "--cell", "1", "-q")
    found, seconds = voids(args.program, store, folder)
    rows = found["voids"]
    places = np.array([[row[a] for a in "xyz"] for row in rows])
    bins, beyond, missed = {}, 0, 0
    for kind, size, centre, volume, area in truth:
        away = np.linalg.norm(places - centre, axis=1)
        # A thin shape may fall into parts.
        mine = [rows[n] for n in np.flatnonzero(away < pitch / 2)]
        if not mine:
            missed += 1
            continue
        row = dict(mine[0])
        for part in mine[1:]:
            for name in ("volume", "surface", "volume_error"):
                row[name] += part[name]
        if abs(row["volume"] - volume) > row["volume_error"] * (1 + 1e-9):
            beyond += 1
            parts = [(part["volume"], part["volume_error"]) for part in mine]
            print(f"{kind} of {size:.3f} cells: {volume:.5f}, found {row['volume']:.5f} ± {row['volume_error']:.5f} in {parts}")
        span = next(name for name, most in (("1-2", 2), ("2-4", 4), ("4-8", 8), ("8-16", 17)) if size < most)
        entry = (abs(row["volume"] / volume - 1), abs(row["surface"] / area - 1), row["volume_error"] / volume,
                 abs(row["sphericity"] - 1) if kind == "ball" and row["sphericity"] else None)
        bins.setdefault(span, []).append(entry)
    print(f"{count} shapes, {len(rows)} voids in {seconds:.1f} s, {missed} not found, {beyond} beyond their stated error")
    print("| radius, cells | shapes | median volume error | largest | median surface error | largest | median stated error | largest 1 − sphericity of balls |")
    print("|---|---|---|---|---|---|---|---|")
    for span in sorted(bins):
        v, s, e, r = zip(*bins[span])
        round_ones = [x for x in r if x is not None]
        print(f"| {span} | {len(v)} | {100 * np.median(v):.3f} % | {100 * max(v):.2f} % | {100 * np.median(s):.3f} % "
              f"| {100 * max(s):.2f} % | {100 * np.median(e):.2f} % | {max(round_ones, default=float('nan')):.4f} |")
    return beyond


def partition(args, folder):
    """The components of voids are those of cc3d, up to their names."""
    random = np.random.default_rng(2)
    axis = args.axis
    size = axis * 31 / 32
    parts = [box([0] * 3, [size] * 3)]
    for _ in range(args.balls):
        radius = math.exp(random.uniform(math.log(1.5), math.log(axis / 16)))
        parts.append(flipped(ball(3) * radius + random.uniform(radius, size - radius, 3)))
    stl, store = folder / "p.stl", folder / "p.brf"
    write_stl(stl, parts)
    depth = int(math.log2(axis // 32))
    run(args.program, "build", stl, "-o", store, "--depth", depth, "-q")
    bad = 0
    print("| axis | connectivity | voids | of cc3d | labels that differ | export, s | cc3d and statistics, s | GiB | voids, s | GiB |")
    print("|---|---|---|---|---|---|---|---|---|---|")
    # Before this process maps arrays: what it holds counts as its children's.
    alone = {n: taken(args.program, store, folder, "--connectivity", n) for n in (6, 26)}
    for connectivity in (6, 26):
        labels = folder / "labels.npy"
        voids(args.program, store, folder, "--connectivity", connectivity, "--labels", labels)
        began = time.time()
        run(args.program, "export", store, "--level", depth, "-o", folder / "w.npy", "-q")
        exported = time.time() - began
        # In a process of its own, which tells its memory.
        theirs = multiprocessing.Process(target=label, args=(folder / "w.npy", folder / "theirs.npy", connectivity))
        theirs.start()
        theirs.join()
        their_seconds, their_memory = json.loads((folder / "theirs.json").read_text())
        pairs = compared(np.load(labels, mmap_mode="r"), np.load(folder / "theirs.npy", mmap_mode="r"))
        own, other = (len({pair[n] for pair in pairs}) for n in range(2))
        differ = len(pairs) - min(own, other)
        bad += differ + abs(own - other)
        print(f"| {axis} | {connectivity} | {own - 1} | {other - 1} | {differ} | {exported:.1f} | {their_seconds:.1f} | {their_memory:.2f} "
              f"| {alone[connectivity][0]:.1f} | {alone[connectivity][1]:.2f} |", flush=True)
    return bad


def taken(program, store, folder, *options):
    """The seconds that `voids` takes, and the most memory that it holds, in GiB."""
    began = time.time()
    process = subprocess.Popen([program, "voids", store, "-o", folder / "voids.json", "-q", *map(str, options)])
    most = os.wait4(process.pid, 0)[2].ru_maxrss / 2**20
    return time.time() - began, most


def label(samples, out, connectivity):
    import cc3d

    began = time.time()
    void = np.load(samples) < 1
    theirs = cc3d.connected_components(void, connectivity=connectivity)
    cc3d.statistics(theirs)
    took, most = time.time() - began, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    out.with_suffix(".json").write_text(json.dumps([took, most]))
    np.save(out, theirs)


def compared(ours, theirs):
    """The pairs of labels at the same samples, slab by slab; what hangs together with the first sample is 0 in both."""
    outside, pairs = theirs[0, 0, 0], set()
    for one, other in zip(ours, theirs):
        other = np.where(other == outside, 0, other)
        both = one.ravel().astype(np.int64) << 32 | other.ravel().astype(np.int64)
        # Most neighbours are alike, and sorting is what takes time.
        both = np.unique(both[np.flatnonzero(np.diff(both, prepend=-1))])
        pairs.update(zip((both >> 32).tolist(), (both & 0xffffffff).tolist()))
    return pairs


def ladder(args, folder):
    """The cavities of void_ladder, from the mesh and from a print of it."""
    truth = json.loads((HERE / "stl_truth.json").read_text())
    print(json.dumps(truth.get("void_ladder", truth), indent=0)[:400])
    store = folder / "l.brf"
    run(args.program, "build", HERE / "stl/void_ladder.stl", "-o", store, "--depth", "4", "-q")
    found, seconds = voids(args.program, store, folder)
    for row in found["voids"]:
        print({k: row[k] for k in ("volume", "volume_error", "surface", "sealed", "x", "y", "z")})
    for gcode in args.toolpaths:
        run(args.program, "build", gcode, "-o", store, "--identity", "-q")
        for options in ((), ("--closing", args.closing)):
            found, seconds = voids(args.program, store, folder, "--min-volume", "0.2", *options)
            print(pathlib.Path(gcode).name, *options, f"{found['count']} voids, {found['left_out']} smaller, {seconds:.1f} s")
            for row in found["voids"][:args.rows]:
                print({k: row[k] for k in ("class", "volume", "volume_error", "throat", "sealed", "x", "y", "z", "inner_diameter", "features")})
    return 0


def leaks(args, folder):
    """Cavities below a face with a hole through it, or a wall that is left, of 0.02 to 2 cells."""
    random = np.random.default_rng(4)
    side = math.ceil(math.sqrt(2 * args.each))
    pitch = args.pitch
    parts, truth = [box([0] * 3, [side * pitch, side * pitch, pitch])], []
    for n in range(2 * args.each):
        centre = np.array([n % side * pitch + pitch / 2, n // side * pitch + pitch / 2, pitch / 2]) + random.uniform(-1, 1, 3)
        width = math.exp(random.uniform(math.log(0.02), math.log(2)))
        half = pitch / 6
        parts.append(flipped(box(centre - half, centre + half)))
        turn = random.uniform(0, 2) - 1
        if n % 2:
            # A hole of this width, up through the face.
            low = [centre[0] + turn, centre[1] - turn, centre[2] + half - 0.5]
            high = [low[0] + width, low[1] + width, pitch + 1]
        else:
            # A hole of 3 cells that stops this far below the face.
            low = [centre[0] - 1.5 + turn, centre[1] - 1.5, centre[2] + half - 0.5]
            high = [low[0] + 3, low[1] + 3, pitch - width]
        parts.append(flipped(box(low, high)))
        truth.append((bool(n % 2), centre, width))
    stl, store = folder / "k.stl", folder / "k.brf"
    write_stl(stl, parts)
    run(args.program, "build", stl, "-o", store, "--cell", "1", "-q")
    bad = 0
    for source in ((), ("--source", stl)):
        found, seconds = voids(args.program, store, folder, *source)
        rows = found["voids"]
        places = np.array([[row[a] for a in "xyz"] for row in rows]).reshape(-1, 3)
        wrong = open_kept = sealed_open = undecided = 0
        for leaks_out, centre, width in truth:
            near = np.linalg.norm(places - centre, axis=1) < pitch / 3 if len(places) else np.array([])
            mine = [rows[i]["sealed"] for i in np.flatnonzero(near)]
            undecided += "to_cell" in mine
            wrong += ("certain" if leaks_out else "no") in mine
            open_kept += leaks_out and bool(mine)
            sealed_open += not leaks_out and not mine
        print(f"{'with' if source else 'without'} the source: {len(truth)} cavities in {seconds:.1f} s: {wrong} wrong, {undecided} to_cell; "
              f"{open_kept} leaks that samples miss, {sealed_open} walls that samples miss")
        bad += wrong
    return bad


def lens(radius, distance):
    """Area that two discs have in common."""
    if distance >= 2 * radius:
        return 0.0
    half = distance / 2
    return 2 * radius * radius * math.acos(half / radius) - half * math.sqrt(4 * radius * radius - distance * distance)


def overlap(args, folder):
    """Two crossing cylinders, and two parallel beads, against closed forms."""
    bad = 0
    print("| beads | cells in half a height | overlap | closed form | off |")
    print("|---|---|---|---|---|")
    head = "G21\nG90\nM83\n;LAYER_CHANGE\n;Z:1\n;HEIGHT:1\nG1 Z1 F600\n"
    for cells in (4, 8, 12, 16):
        r, length, width, spacing = 0.5, 20.0, 1.0, 0.83
        programs = {
            "crossing cylinders": (1.0, "G0 X0.013 Y10\nG1 X20 Y10 E1 F600\nG0 X10.007 Y0\nG1 X10.007 Y20 E1\n", 16 / 3 * r ** 3),
            "parallel cylinders": (width, f"G0 X0 Y0.011\nG1 X{length} Y0.011 E1 F600\nG0 X0 Y{spacing + 0.011}\nG1 X{length} Y{spacing + 0.011} E1\n", None),
            "parallel stadia": (2.0, f"G0 X0 Y0.011\nG1 X{length} Y0.011 E1 F600\nG0 X0 Y1.711\nG1 X{length} Y1.711 E1\n", None),
        }
        for name, (width, text, exact) in programs.items():
            if exact is None:
                apart = spacing if width == 1.0 else 1.7
                flat = (width - 2 * r) / 2
                zs = (np.arange(20000) + 0.5) / 20000 * 2 * r - r
                b = flat + np.sqrt(r * r - zs * zs)
                slices = 2 * np.maximum(b - apart / 2, 0)
                ends = [lens(x, apart) for x in b]
                exact = (slices.sum() * length + sum(ends)) * 2 * r / len(zs)
            path, store, out = folder / "o.gcode", folder / "o.brf", folder / "o.json"
            path.write_text(head + text)
            run(args.program, "build", path, "-o", store, "--identity", "-q", "--width", f"{width}mm", "--height", "1mm",
                "--cell", f"{0.4999 / cells}mm")
            run(args.program, "overlap", store, "-o", out, "-q")
            found = json.loads(out.read_text())
            off = found["volume"] / exact - 1
            bad += found["pair_samples"] != found["field_samples"] or (cells >= 12 and abs(off) > 0.002)
            print(f"| {name} | {cells} | {found['volume']:.5f} | {exact:.5f} | {100 * off:+.3f} % |")
    return bad


def manifold(args, folder):
    """The overlaps of beads, cylinders of 1 mm in crossed layers, and their pairwise intersections by Manifold (`manifold3d`)."""
    import manifold3d

    radius, length, text, beads = 0.5, 20.0, ["G21", "G90", "M83"], []
    for n in range(args.beads):
        layer, place = divmod(n, 100)
        z, aside, along = 1 + 0.9 * layer, 0.83 * (place % 24) + 0.0137, 25 * (place // 24)
        if place == 0:
            text += [";LAYER_CHANGE", f";Z:{z:.3f}", ";HEIGHT:1", f"G1 Z{z:.3f} F600"]
        ends = ((along, aside), (along + length, aside)) if layer % 2 == 0 else ((along + aside, 0.0), (along + aside, length))
        beads.append((*ends, z - radius))
        text += [f"G0 X{ends[0][0]:.4f} Y{ends[0][1]:.4f}", f"G1 X{ends[1][0]:.4f} Y{ends[1][1]:.4f} E1"]
    end = manifold3d.Manifold.sphere(radius, 24)
    hull = manifold3d.Manifold.batch_hull
    solids = [hull([end.translate((*p, z)), end.translate((*q, z))]) for p, q, z in beads]
    low = np.array([[min(p[0], q[0]) - radius, min(p[1], q[1]) - radius, z - radius] for p, q, z in beads])
    high = np.array([[max(p[0], q[0]) + radius, max(p[1], q[1]) + radius, z + radius] for p, q, z in beads])
    began, pairs, volume = time.time(), 0, 0.0
    for n, one in enumerate(solids):
        meets = (low[n + 1:] < high[n]).all(1) & (high[n + 1:] > low[n]).all(1)
        for other in np.flatnonzero(meets) + n + 1:
            common = (one ^ solids[int(other)]).volume()
            pairs += common > 1e-9
            volume += max(common, 0)
    theirs = time.time() - began
    path, store, out = folder / "m.gcode", folder / "m.brf", folder / "m.json"
    path.write_text("\n".join(text) + "\n")
    began = time.time()
    run(args.program, "build", path, "-o", store, "--identity", "-q", "--width", "1mm", "--height", "1mm", "--cell", args.cell)
    built = time.time() - began
    began = time.time()
    run(args.program, "overlap", store, "-o", out, "-q")
    ours, found = time.time() - began, json.loads(out.read_text())
    print(f"{args.beads} beads of {solids[0].num_tri()} triangles; Manifold: {pairs} pairs, {volume:.1f} mm³, {theirs:.1f} s; "
          f"build {built:.1f} s, overlap: {found['pairs']} pairs, {found['volume']:.1f} mm³, {ours:.1f} s, {theirs / ours:.1f} times as fast")
    return 0


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", default="target/release/brickfield")
    sub = parser.add_subparsers(required=True)
    for name, options in {
        shapes: {"--each": 500},
        partition: {"--axis": 256, "--balls": 3000},
        ladder: {"--closing": "0.8mm", "--toolpaths": [], "--rows": 8},
        leaks: {"--each": 200, "--pitch": 64},
        overlap: {},
        manifold: {"--beads": 3000, "--cell": "0.2mm"},
    }.items():
        command = sub.add_parser(name.__name__, help=name.__doc__)
        command.set_defaults(run=name)
        for option, value in options.items():
            many = {"nargs": "*"} if isinstance(value, list) else {"type": type(value)}
            command.add_argument(option, default=value, **many)
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        sys.exit(1 if args.run(args, pathlib.Path(folder)) else 0)


if __name__ == "__main__":
    main()
