#!/usr/bin/env python3
"""Opens what `brickfield export` writes with the programs that users have, and compares.

    bench-data/readers.py --program target/release/brickfield [--store PART.brf] [--packages]

Makes a virtual environment with the pinned packages below, exports a store in every format, and asks each reader for
10,000 random samples and for all samples of one brick. The judge is `brickfield sample`. A reader that is not there is
named, with the reason; --packages installs those of Debian, and needs the rights for it. Status 1 if a reader differs.
"""

import argparse
import json
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

PYPI = [
    "numpy==2.4.6",
    "vtk==9.7.2",
    "h5py==3.16.0",
    "zarr==3.1.6",
    "tensorstore==0.1.86",
    "ome-zarr==0.18.0",
    "SimpleITK==2.5.7",
    "tifffile==2026.3.3",
    "pyvista==0.49.1",
]
OLD_VTK = ["numpy==1.26.4", "vtk==9.2.6"]
DEBIAN = ["libopenvdb-tools", "python3-openvdb", "python3-numpy"]
POINTS = 10_000
HERE = Path(__file__).resolve().parent

# Each reader gets W (the file) and I (samples as an array of x, y, z), and leaves V (their values).
READERS = [
    ("numpy", "npy", "env", "import numpy as np; V = np.load(W)[I[:,2], I[:,1], I[:,0]]"),
    (
        "pyopenvdb",
        "vdb",
        "system",
        "import pyopenvdb as vdb; a = vdb.read(W, 'w').getAccessor(); "
        "V = [a.getValue(tuple(int(c) for c in p)) for p in I]",
    ),
    ("vtk 9.7 vtkHDFReader", "vtkhdf", "env", "AMR"),
    ("vtk 9.2 vtkHDFReader", "vtkhdf", "old", "AMR"),
    (
        "h5py",
        "vtkhdf",
        "env",
        """
import h5py
g = h5py.File(W)['VTKHDF']
level = sorted(k for k in g if k.startswith('Level'))[-1]
boxes, points = g[level]['AMRBox'][:], g[level]['PointData/w']
place = {(b[0] // 32, b[2] // 32, b[4] // 32): n for n, b in enumerate(boxes)}
blocks, V = {}, []
for x, y, z in I:
    n = place.get((x // 32, y // 32, z // 32))
    if n is None:
        V.append(None)
        continue
    if n not in blocks:
        blocks[n] = points[n * 33**3:(n + 1) * 33**3]
    V.append(blocks[n][((z % 32) * 33 + y % 32) * 33 + x % 32])
""",
    ),
    ("zarr", "zarr", "env", "import zarr; a = zarr.open(W)['0'][:]; V = a[I[:,2], I[:,1], I[:,0]]"),
    (
        "tensorstore",
        "zarr",
        "env",
        "import tensorstore as ts; a = ts.open({'driver': 'zarr3', 'kvstore': 'file://' + W + '/0'}).result().read()"
        ".result(); V = a[I[:,2], I[:,1], I[:,0]]",
    ),
    (
        "ome-zarr",
        "zarr",
        "env",
        "from ome_zarr.io import parse_url; from ome_zarr.reader import Reader; import numpy as np; "
        "a = np.asarray(next(Reader(parse_url(W))()).data[0]); V = a[I[:,2], I[:,1], I[:,0]]",
    ),
    (
        "pyvista",
        "vti",
        "env",
        "import pyvista as pv; m = pv.read(W); d = m.dimensions; "
        "V = m['w'][(I[:,2] * d[1] + I[:,1]) * d[0] + I[:,0]]",
    ),
    (
        "SimpleITK",
        "mhd",
        "env",
        "import SimpleITK as s; a = s.GetArrayFromImage(s.ReadImage(W)); V = a[I[:,2], I[:,1], I[:,0]]",
    ),
    (
        "SimpleITK",
        "mha",
        "env",
        "import SimpleITK as s; a = s.GetArrayFromImage(s.ReadImage(W)); V = a[I[:,2], I[:,1], I[:,0]]",
    ),
    ("tifffile", "tif", "env", "import tifffile as t; a = t.imread(W); V = a[I[:,2], I[:,1], I[:,0]]"),
]
AMR = """
import vtk
r = vtk.vtkHDFReader()
r.SetFileName(W)
r.Update()
o = r.GetOutputDataObject(0)
level = o.GetNumberOfLevels() - 1
get = o.GetDataSetAsImageData if hasattr(o, 'GetDataSetAsImageData') else o.GetDataSet
count = o.GetNumberOfDataSets(level) if hasattr(o, 'GetNumberOfDataSets') else o.GetNumberOfBlocks(level)
origin = get(0, 0).GetOrigin()
place = {}
for n in range(count):
    d = get(level, n)
    place[tuple(round((d.GetOrigin()[a] - origin[a]) / d.GetSpacing()[a] / 32) for a in range(3))] = d
V = []
for x, y, z in I:
    d = place.get((x // 32, y // 32, z // 32))
    V.append(None if d is None else d.GetPointData().GetArray('w').GetTuple1(int(((z % 32) * 33 + y % 32) * 33 + x % 32)))
"""


def run(*command, **more):
    return subprocess.run([str(c) for c in command], check=True, capture_output=True, text=True, **more).stdout


def environment(folder, packages):
    """A virtual environment's interpreter, or the reason why there is none."""
    python = folder / "bin" / "python"
    try:
        run(sys.executable, "-m", "venv", folder)
        run(python, "-m", "pip", "install", "--quiet", *packages)
    except (subprocess.CalledProcessError, OSError) as error:
        return None, (getattr(error, "stderr", "") or str(error)).strip().splitlines()[-1]
    return python, ""


def judged(program, store, description, chosen):
    """Values by `brickfield sample`."""
    origin, step = description["origin"], description["spacing"]
    lines = [",".join(repr(o + step * i) for o, i in zip(origin, point)) for point in chosen]
    answer = run(program, "sample", store, "--points", "-", input="x,y,z\n" + "\n".join(lines) + "\n")
    return [float(line.rsplit(",", 1)[1]) for line in answer.splitlines()[1:]]


def samples(axis, truth_brick):
    """Random samples, and all of one brick."""
    chance = random.Random(1)
    chosen = [[chance.randrange(axis) for _ in range(3)] for _ in range(POINTS)]
    first = [32 * b for b in truth_brick]
    chosen += [[first[0] + n % 32, first[1] + n // 32 % 32, first[2] + n // 1024] for n in range(32**3)]
    return chosen


def read(python, code, path, chosen, folder):
    """A reader's values."""
    (folder / "chosen.json").write_text(json.dumps(chosen))
    script = (
        "import json, numpy as np\n"
        f"W = {str(path)!r}\nI = np.array(json.load(open({str(folder / 'chosen.json')!r})))\n"
        f"{code}\njson.dump([None if v is None else float(v) for v in V], open({str(folder / 'values.json')!r}, 'w'))\n"
    )
    subprocess.run([str(python), "-c", script], check=True, capture_output=True, text=True)
    return json.loads((folder / "values.json").read_text())


def compare(program, store, folder, pythons):
    """A line for each reader; returns whether all agree."""
    files, sizes = {}, {}
    for ending in {ending for _, ending, _, _ in READERS}:
        files[ending] = folder / f"w.{ending}"
        begun = time.time()
        description = json.loads(run(program, "export", store, "-o", files[ending], "--json"))
        beside = {"mhd": folder / "w.raw"}.get(ending)
        parts = [p for f in (files[ending], beside) if f for p in ([f] if f.is_file() else f.rglob("*"))]
        sizes[ending] = (sum(p.stat().st_size for p in parts if p.is_file()), time.time() - begun)
    axis = description["shape"][0]
    brick = [b // 64 for b in [axis] * 3]
    chosen = samples(axis, brick)
    truth = judged(program, store, description, chosen)
    agreed = True
    for name, ending, where, code in READERS:
        python, reason = pythons[where]
        size, seconds = sizes[ending]
        if python is None:
            print(f"{name:22} .{ending:7} NOT HERE: {reason}")
            continue
        try:
            values = read(python, AMR if code == "AMR" else code, files[ending], chosen, folder)
            pairs = [(v, t) for v, t in zip(values, truth) if v is not None]
            wrong = sum(v != t for v, t in pairs)
            # A block that a format leaves out is one that a coarser level covers.
            told = f"{len(pairs)} samples, {wrong} differ"
            agreed &= wrong == 0 and len(pairs) > 32**3
        except subprocess.CalledProcessError as error:
            lines = error.stderr.strip().splitlines()
            if where == "system" and "No module" in lines[-1]:
                print(f"{name:22} .{ending:7} NOT HERE: {lines[-1]}")
                continue
            told, agreed = lines[-1], False
        print(f"{name:22} .{ending:7} {told}; {size:,} bytes, exported in {seconds:.2f} s")
    if shutil.which("vdb_print"):
        told = run("vdb_print", files["vdb"]).split("\n")[0]
        print(f"{'vdb_print':22} .vdb     {told}")
    else:
        print(f"{'vdb_print':22} .vdb     NOT HERE: no such program")
    return agreed


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", type=Path, required=True)
    parser.add_argument("--store", type=Path, help="a store of closed input [default: the clover at depth 3]")
    parser.add_argument("--packages", action="store_true", help="install Debian's packages, too")
    args = parser.parse_args()
    if args.packages:
        subprocess.run(["apt-get", "update", "-q"], check=False)
        subprocess.run(["apt-get", "install", "-y", "-q", "--no-install-recommends", *DEBIAN], check=False)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        store = args.store
        if store is None:
            store = folder / "clover.brf"
            run(args.program, "build", HERE / "clover.gcode", "-o", store, "--depth", "3", "--quiet")
        system = "/usr/bin/python3" if os.path.exists("/usr/bin/python3") else None
        pythons = {
            "env": environment(folder / "env", PYPI),
            "old": environment(folder / "old", OLD_VTK),
            "system": (system, "no python3 of the system"),
        }
        return 0 if compare(args.program, store, folder, pythons) else 1


if __name__ == "__main__":
    sys.exit(main())
