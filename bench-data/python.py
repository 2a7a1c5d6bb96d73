#!/usr/bin/env python3
"""What the Python package takes beside the program, and its winding numbers beside libigl's and MeshLib's.

    pip install WHEEL libigl meshlib pyvista
    python bench-data/python.py overhead PART.stl --program target/release/brickfield
    python bench-data/python.py winding PART.stl...

`overhead` builds PART.stl to a store and samples it at 10 million points by turns, with the program and in this process, and
prints medians. `winding` asks for winding numbers of the files, of meshes that pyvista has as examples, and of MeshLib's and
libigl's own, at the same random points, by turns. Differences are those from libigl's sum of all solid angles.
"""

import argparse
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import brickfield

CHECKED = 2_000


def measured(work, who=resource.RUSAGE_SELF):
    """What work gives, seconds, and seconds of processor of this process or of its children."""
    before, begun = resource.getrusage(who), time.perf_counter()
    result = work()
    seconds, after = time.perf_counter() - begun, resource.getrusage(who)
    return result, seconds, after.ru_utime - before.ru_utime, after.ru_stime - before.ru_stime


def median(values):
    return statistics.median(values)


# ---------------------------------------------------------------------------------------------------------------- overhead


def by_turns(rounds, ways):
    """Seconds of each way in each round; the way that begins changes from round to round."""
    found = {name: [] for name in ways}
    for n in range(rounds):
        names = list(ways) if n % 2 == 0 else list(ways)[::-1]
        for name in names:
            found[name].append(ways[name]())
    return found


def told(name, found, base):
    """A row: medians of seconds and processor seconds, and of their ratios to the base, round by round."""
    rows = found[name]
    ratios = [[row[k] / of[k] for row, of in zip(rows, found[base])] for k in (0, 1)]
    cells = [f"{median(row[k] for row in rows):.2f}" for k in (0, 1)]
    spans = [f"{median(ratio):.3f} ({min(ratio):.3f} to {max(ratio):.3f})" for ratio in ratios]
    print(f"| {name} | {' | '.join(cells)} | {' | '.join(spans)} |", flush=True)


def overhead(args):
    with tempfile.TemporaryDirectory(dir=args.folder) as name:
        folder = Path(name)
        store, other = folder / "part.brf", folder / "other.brf"
        settings = ["--depth", str(args.depth), "--quiet", "--restart"]

        def program(*command, out=None):
            run = lambda: subprocess.run([*args.program.split(), *map(str, command)], check=True, stdout=out)
            _, seconds, user, system = measured(run, resource.RUSAGE_CHILDREN)
            return seconds, user + system

        def here(work):
            _, seconds, user, system = measured(work)
            return seconds, user + system

        def fresh(path):
            path.unlink(missing_ok=True)
            return path

        head = "| | s | processor, s | × s | × processor, s |\n|---|---|---|---|---|"
        print(head)
        build = by_turns(args.rounds, {
            "`brickfield build`": lambda: program("build", args.part, "-o", fresh(store), *settings),
            "`brickfield.build`": lambda: here(lambda: brickfield.build(args.part, fresh(other), depth=args.depth)),
        })
        for name in build:
            told(name, build, "`brickfield build`")
        same = store.read_bytes() == other.read_bytes()
        print(f"the stores have {'the same bytes' if same else 'OTHER BYTES'}")

        part = brickfield.open(store)
        low, high = part.bounds
        points = np.random.default_rng(1).uniform(low, high, (args.points, 3))
        csv = folder / "points.csv"
        with csv.open("w") as file:
            for rows in np.array_split(points, 100):
                file.write("".join(f"{x!r},{y!r},{z!r}\n" for x, y, z in rows.tolist()))
        printed = folder / "samples.csv"
        values = []

        def sampled():
            with printed.open("wb") as out:
                return program("sample", store, "--points", csv, "--quiet", out=out)

        sample = by_turns(args.rounds, {
            "`brickfield sample`, CSV to CSV": sampled,
            "`sample`, array to array": lambda: here(lambda: values.append(part.sample(points))),
        })
        for name in sample:
            told(name, sample, "`brickfield sample`, CSV to CSV")
        with printed.open() as file:
            next(file)
            of_program = np.fromiter((line.rsplit(",", 1)[1] for line in file), np.float64, args.points)
        print(f"{args.points:,} samples differ by {np.abs(of_program - values[-1]).max():.1e} at most")
    start = ["import", "numpy", "import numpy; import brickfield"]
    for code in start[1:]:
        code = code if " " in code else f"import {code}"
        times = [measured(lambda: subprocess.run([sys.executable, "-c", code], check=True), resource.RUSAGE_CHILDREN)[1]
                 for _ in range(args.rounds)]
        print(f"`python -c '{code}'`: {median(times):.2f} s")


# ----------------------------------------------------------------------------------------------------------------- winding


def read_stl(path):
    """Vertices and triangles of a binary STL, vertices at one place joined."""
    record = np.dtype([("normal", "<f4", 3), ("facet", "<f4", (3, 3)), ("attribute", "<u2")])
    facets = np.frombuffer(Path(path).read_bytes()[84:], record)["facet"]
    vertices, corners = np.unique(facets.reshape(-1, 3), axis=0, return_inverse=True)
    return vertices.astype(np.float64), corners.reshape(-1, 3).astype(np.int64)


def example_meshes(files):
    """Names, vertices and triangles."""
    import igl
    import meshlib.mrmeshnumpy as mrmeshnumpy
    import meshlib.mrmeshpy as mrmeshpy

    for name in ("makeTorus", "makeTorusWithSelfIntersections", "makeSphere"):
        made = getattr(mrmeshpy, name)
        mesh = made(mrmeshpy.SphereParams()) if name == "makeSphere" else made(1.0, 0.4, 256, 256)
        yield f"MeshLib {name}", mrmeshnumpy.getNumpyVerts(mesh).astype(np.float64), mrmeshnumpy.getNumpyFaces(mesh.topology).astype(np.int64)
    vertices, triangles = igl.icosahedron()
    for _ in range(5):
        vertices, triangles = igl.loop(vertices, triangles)
    yield "libigl icosahedron, 5 × loop", np.asarray(vertices), np.asarray(triangles, dtype=np.int64)
    try:
        import pyvista
        from pyvista import examples

        for name in ("planefile", "antfile"):
            mesh = pyvista.read(getattr(examples, name)).triangulate()
            yield f"pyvista {name}", np.asarray(mesh.points, dtype=np.float64), mesh.regular_faces.astype(np.int64)
    except ImportError as error:
        print(f"pyvista: {error}")
    for file in files:
        yield (Path(file).name, *read_stl(file))


class Brickfield:
    name = "Brickfield"

    def __init__(self, vertices, triangles):
        self.winding = brickfield.Winding(vertices, triangles)

    def __call__(self, points):
        return self.winding(points)


class Libigl:
    name = "libigl"

    def __init__(self, vertices, triangles):
        import igl

        self.tree = igl.FastWindingNumberBVH()
        self.tree.init(vertices, triangles, 2)

    def __call__(self, points):
        return np.asarray(self.tree.winding_number(points))


class MeshLib:
    name = "MeshLib"

    def __init__(self, vertices, triangles):
        import meshlib.mrmeshnumpy as mrmeshnumpy
        import meshlib.mrmeshpy as mrmeshpy

        self.module = mrmeshpy
        self.mesh = mrmeshnumpy.meshFromFacesVerts(triangles.astype(np.int32), vertices.astype(np.float32))
        self.tree = mrmeshpy.FastWindingNumber(self.mesh)

    def __call__(self, points):
        # Its own vectors, filled outside of the measured time.
        values = self.module.std_vector_float()
        self.tree.calcFromVector(values, points, 2.0, self.module.FaceId(), self.module.func_bool_from_float())
        return values

    def taken(self, points):
        vectors = self.module.std_vector_Vector3_float()
        vectors.resize(len(points))
        for n, (x, y, z) in enumerate(points):
            vectors[n] = self.module.Vector3f(x, y, z)
        return vectors


def winding(args):
    import igl

    print("| mesh | facets | | first, s | all, s | processor, s | rms difference | largest | wrong side |")
    print("|---|---|---|---|---|---|---|---|---|")
    for mesh, vertices, triangles in example_meshes(args.files):
        low, high = vertices.min(axis=0), vertices.max(axis=0)
        margin = 0.05 * (high - low).max()
        points = np.random.default_rng(1).uniform(low - margin, high + margin, (args.points, 3))
        # MeshLib takes 32 bits.
        points = points.astype(np.float32).astype(np.float64)
        exact = np.asarray(igl.winding_number(vertices, triangles, points[:CHECKED]))
        ways, times, values = {}, {}, {}
        for way in (Brickfield, Libigl, MeshLib):
            made, seconds, _, _ = measured(lambda: way(vertices, triangles))
            ways[way.name] = made, made.taken(points) if way is MeshLib else points
            times[way.name] = [seconds]
        runs = by_turns(args.rounds, {
            name: lambda name=name: measured(lambda: values.update({name: ways[name][0](ways[name][1])}))[1:]
            for name in ways
        })
        for name in ways:
            found = np.array(list(values[name]), dtype=np.float64)[:CHECKED]
            apart = np.abs(found - exact)
            wrong = np.mean((found >= 0.5) != (exact >= 0.5))
            seconds, processor = median(row[0] for row in runs[name]), median(row[1] + row[2] for row in runs[name])
            print(f"| {mesh} | {len(triangles):,} | {name} | {times[name][0]:.3f} | {seconds:.3f} | {processor:.3f} | "
                  f"{np.sqrt(np.mean(apart**2)):.1e} | {apart.max():.1e} | {100 * wrong:.2f} % |", flush=True)
            mesh = ""


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(required=True)
    one = commands.add_parser("overhead")
    one.set_defaults(run=overhead)
    one.add_argument("part", type=Path)
    one.add_argument("--program", default=f"{sys.executable} -m brickfield", help="the program, that of the package by default")
    one.add_argument("--depth", type=int, default=5)
    one.add_argument("--points", type=int, default=10_000_000)
    one.add_argument("--folder", type=Path, help="for the stores")
    two = commands.add_parser("winding")
    two.set_defaults(run=winding)
    two.add_argument("files", nargs="*", help="binary STL")
    two.add_argument("--points", type=int, default=100_000)
    for command in (one, two):
        command.add_argument("--rounds", type=int, default=5)
    args = parser.parse_args()
    args.run(args)


if __name__ == "__main__":
    main()
