#!/usr/bin/env python3
"""Hashes what brickfield writes for a fixed set of inputs, for changes that must not change a byte.

Run it with the program of before and keep the table; run it with the program of after and compare:

    bench-data/same_bytes.py target/before/brickfield > before.txt
    bench-data/same_bytes.py target/release/brickfield --compare before.txt

A line of the table is a SHA-256 and a name. Stores, meshes, sections, pictures, arrays and JSON are hashed: of JSON
all but times, rates, paths and memory. All is done by the processor. The exit status is 1 if a line differs.
"""

import argparse
import hashlib
import json
import lzma
import re
import subprocess
import sys
import tempfile
from pathlib import Path

DATA = Path(__file__).resolve().parent
# Keys of JSON whose values depend on the machine or on the moment.
VOLATILE = re.compile(r"second|rate|memory|rss|thread|path|file|output|device|mib|time|speed|progress|free|phase", re.I)

# Names of stores, with the inputs below bench-data (or generated, see `prepared`) and the options of `build`.
STORES = {
    "cavity": (["stl/box_with_cavity.stl"], ["--depth", "2"]),
    "overlap": (["stl/overlap_boxes.stl"], ["--depth", "2", "--compression", "range"]),
    "touching": (["stl/touching_layers.stl"], ["--depth", "2", "--compression", "none"]),
    "model": (["stl/spot40_model.stl"], ["--depth", "3", "--boundary-error", "0.05mm"]),
    "ladder": (["stl/thinwall_ladder.stl"], ["--depth", "2", "--max-depth", "4"]),
    "pile": (["random.stl"], ["--depth", "3", "--stddev", "0.3"]),
    "surface": (["random.stl"], ["--depth", "3", "--refine", "surface"]),
    "open": (["stl/open_box_no_lid.stl"], ["--depth", "2"]),
    "turned": (["stl/inverted_box.stl"], ["--depth", "1", "--orient"]),
    "cloud": (["cloud.xyz"], ["--depth", "2", "--estimate-normals"]),
    "x3d": (["x3d/clover_beads.x3d"], ["--depth", "3"]),
    "swept": (["clover.gcode"], ["--depth", "3", "--beads-as", "mesh"]),
    "beads": (["clover.gcode"], ["--depth", "4", "--identity"]),
    "by_beads": (["featuretype.gcode"], ["--depth", "3", "--count", "beads", "--skip", "auto"]),
    "nonplanar": (["gcode/nonplanar.gcode"], ["--depth", "3"]),
    "shard1": (["clover.gcode"], ["--depth", "4", "--shard", "1/2"]),
    "shard2": (["clover.gcode"], ["--depth", "4", "--shard", "2/2"]),
}

# Outputs: name, store, command with its options; the output is appended.
OUTPUTS = [
    (f"{store}.{ending}", store, ["mesh"])
    for store in ("cavity", "overlap", "touching", "model", "ladder", "pile", "open", "cloud", "beads", "nonplanar")
    for ending in ("stl",)
] + [
    ("beads.ply", "beads", ["mesh", "--normals"]),
    ("beads.obj", "beads", ["mesh", "--level", "2"]),
    ("beads.glb", "beads", ["mesh", "--tolerance", "0.2mm"]),
    ("model.3mf", "model", ["mesh", "--tolerance", "0.05mm"]),
    ("model_creases.stl", "model", ["mesh", "--follow-creases"]),
    ("cubes.stl", "touching", ["mesh", "--method", "mc"]),
    ("pile_iso.stl", "pile", ["mesh", "--iso", "1.5"]),
    ("beads_z.png", "beads", ["slice", "--z", "2mm"]),
    ("beads_z.svg", "beads", ["slice", "--z", "2mm"]),
    ("beads_x.dxf", "beads", ["slice", "--x", "100mm", "--merge-tolerance", "0.01mm"]),
    ("open_z.png", "open", ["slice", "--z", "5mm"]),
    ("beads.png", "beads", ["render", "--size", "320x240"]),
    ("overlap.png", "beads", ["render", "--size", "320x240", "--style", "overlap", "--cut", "x>100mm"]),
    ("pile.npy", "pile", ["export", "--level", "2", "--dtype", "i2"]),
    ("cloud.npy", "cloud", ["export", "--level", "1", "--dtype", "f4"]),
]

# What is told about inputs and stores, as JSON.
TOLD = [
    ("info_clover", ["info", "{clover.gcode}", "--json"]),
    ("info_model", ["info", "{stl/featuretype50_model.stl}", "--json"]),
    ("info_x3d", ["info", "{x3d/extrusion_cases.x3d}", "--json"]),
    ("info_cloud", ["info", "{cloud.xyz}", "--json"]),
    ("info_beads", ["info", "{beads.brf}", "--volume", "--json"]),
    ("verify_pile", ["verify", "{pile.brf}", "--json"]),
    ("sample_beads", ["sample", "{beads.brf}", "--points", "{points.csv}", "--beads"]),
    ("winding_open", ["winding", "{stl/open_box_no_lid.stl}", "--points", "{points.csv}", "--backend", "cpu"]),
]


def prepared(folder):
    """Writes the inputs that are not committed as they are read."""
    xz = DATA / "gcode/featuretype50_prusaslicer.gcode.xz"
    (folder / "featuretype.gcode").write_bytes(lzma.open(xz).read())
    state = 12345

    def number():
        nonlocal state
        state = (state * 6364136223846793005 + 1442695040888963407) % (1 << 64)
        return (state >> 33) / (1 << 31)

    points, cloud = ["x,y,z"], []
    for _ in range(500):
        points.append(",".join(f"{number() * 60:.6f}" for _ in range(3)))
    while len(cloud) < 4000:
        at = [2 * number() - 1 for _ in range(3)]
        length = sum(c * c for c in at) ** 0.5
        if 0.1 < length < 1:
            cloud.append(" ".join(f"{10 * c / length:.6f}" for c in at))
    (folder / "points.csv").write_text("\n".join(points) + "\n")
    (folder / "cloud.xyz").write_text("\n".join(cloud) + "\n")
    (folder / "random.stl").write_text(boxes(number))


def boxes(number):
    """Sixty overlapping boxes at random places as text."""
    corners = [[(n >> a) & 1 for a in range(3)] for n in range(8)]
    faces = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    lines = ["solid boxes"]
    for _ in range(60):
        low = [number() * 40 for _ in range(3)]
        size = [2 + number() * 12 for _ in range(3)]
        at = [" ".join(f"{low[a] + c[a] * size[a]:.5f}" for a in range(3)) for c in corners]
        for a, b, c, d in faces:
            for triangle in ((a, b, c), (a, c, d)):
                lines.append("facet normal 0 0 0\nouter loop")
                lines.extend(f"vertex {at[v]}" for v in triangle)
                lines.append("endloop\nendfacet")
    return "\n".join(lines + ["endsolid", ""])


def stable(value):
    """JSON without what depends on the machine or the moment."""
    if isinstance(value, dict):
        return {key: stable(of) for key, of in value.items() if not VOLATILE.search(key)}
    if isinstance(value, list):
        return [stable(of) for of in value]
    return value


def run(program, folder, arguments):
    """Runs it in the folder, whose name changes: what lies there is named by its own name alone."""
    done = subprocess.run([program, *map(str, arguments)], capture_output=True, cwd=folder)
    if done.returncode != 0:
        sys.exit(f"{' '.join(map(str, arguments))}: status {done.returncode}: {done.stderr.decode().strip()}")
    return done.stdout


def table(program, folder):
    prepared(folder)

    def place(name):
        return name if (folder / name).exists() else DATA / name

    def sum_of(name):
        return hashlib.sha256((folder / name).read_bytes()).hexdigest(), name

    for store, (inputs, options) in STORES.items():
        output = f"{store}.brf"
        command = ["build", *map(place, inputs), "-o", output, "--backend", "cpu", "--json", *options]
        told = stable(json.loads(run(program, folder, command)))
        yield hashlib.sha256(json.dumps(told).encode()).hexdigest(), f"build_{store}.json"
        yield sum_of(output)
    run(program, folder, ["cache", "merge", "shard1.brf", "shard2.brf", "-o", "merged.brf"])
    yield sum_of("merged.brf")
    for name, store, command in OUTPUTS:
        backend = ["--backend", "cpu"] if command[0] == "render" else []
        run(program, folder, [command[0], f"{store}.brf", *command[1:], *backend, "-o", name])
        yield sum_of(name)
    for name, command in TOLD:
        told = run(program, folder, [place(part[1:-1]) if part[0] == "{" else part for part in command])
        if "--json" in command:
            told = json.dumps(stable(json.loads(told))).encode()
        yield hashlib.sha256(told).hexdigest(), name


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program", help="the program to run")
    parser.add_argument("--compare", metavar="TABLE", help="a table of before: tell what differs instead")
    options = parser.parse_args()
    program = str(Path(options.program).resolve())
    before = None
    if options.compare:
        before = dict(reversed(line.split(maxsplit=1)) for line in Path(options.compare).read_text().splitlines())
    differing, count = 0, 0
    with tempfile.TemporaryDirectory() as folder:
        for digest, name in table(program, Path(folder)):
            count += 1
            if before is None:
                print(f"{digest}  {name}", flush=True)
            elif before.get(name) != digest:
                differing += 1
                print(f"differs: {name}", flush=True)
    if before is not None:
        print(f"{count} outputs, {differing} differ")
    sys.exit(1 if differing else 0)


if __name__ == "__main__":
    main()
