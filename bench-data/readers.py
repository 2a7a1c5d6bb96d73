#!/usr/bin/env python3
"""Opens what `brickfield` writes with the programs that users have, has it open what those write, and compares.

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
    "trimesh==5.2.0",
    "meshio==5.3.5",
    "lib3mf==2.5.0",
    "lxml==6.1.3",
    "networkx==3.6.1",
    "laspy==2.7.0",
    "lazrs==0.8.2",
    "copclib==2.6.3",
    "pye57==0.4.19",
]
OLD_VTK = ["numpy==1.26.4", "vtk==9.2.6"]
DEBIAN = ["libopenvdb-tools", "python3-openvdb", "python3-numpy", "python3-paraview", "blender"]
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
    ("ParaView", "vtkhdf", "paraview", "AMR"),
    (
        "ParaView",
        "vti",
        "paraview",
        "from paraview import simple, servermanager; m = servermanager.Fetch(simple.OpenDataFile(W)); d = m.GetDimensions(); "
        "a = m.GetPointData().GetArray('w'); V = [a.GetTuple1(int((z * d[1] + y) * d[0] + x)) for x, y, z in I]",
    ),
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
from vtkmodules.vtkIOHDF import vtkHDFReader
r = vtkHDFReader()
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


# Who writes volumes for `build`: each gets W (the file) and N (values, 0 to 3, indexed z, y, x).
WRITERS = [
    (
        "pyopenvdb, blosc",
        "vdb",
        "system",
        "import pyopenvdb as vdb; g = vdb.FloatGrid(0); g.copyFromArray(np.ascontiguousarray(N.astype('f4').transpose(2, 1, 0))); "
        "g.gridClass = 'fog volume'; g.prune(); vdb.write(W, g)",
    ),
    (
        "pyopenvdb, halves",
        "vdb",
        "system",
        "import pyopenvdb as vdb; g = vdb.FloatGrid(0); g.copyFromArray(np.ascontiguousarray(N.astype('f4').transpose(2, 1, 0))); "
        "g.saveFloatAsHalf = True; vdb.write(W, [g])",
    ),
    *(
        (
            f"vtk, {name}",
            "vti",
            "env",
            "import vtk; from vtk.util.numpy_support import numpy_to_vtk; o = vtk.vtkImageData(); "
            "o.SetDimensions(N.shape[::-1]); a = numpy_to_vtk(N.astype(" + repr(kind) + ").ravel()); a.SetName('n'); "
            "o.GetPointData().SetScalars(a); w = vtk.vtkXMLImageDataWriter(); w.SetFileName(W); w.SetInputData(o); "
            + more
            + "; w.Write()",
        )
        for name, kind, more in [
            ("zlib, raw", "f4", "w.SetDataModeToAppended(); w.EncodeAppendedDataOff()"),
            ("zlib, base64", "i2", "w.SetDataModeToAppended(); w.EncodeAppendedDataOn()"),
            ("inline", "f8", "w.SetDataModeToBinary(); w.SetCompressorTypeToNone()"),
            ("raw", "u1", "w.SetDataModeToAppended(); w.EncodeAppendedDataOff(); w.SetCompressorTypeToNone()"),
            ("text", "i8", "w.SetDataModeToAscii()"),
        ]
    ),
    (
        "SimpleITK, zlib",
        "mha",
        "env",
        "import SimpleITK as s; s.WriteImage(s.GetImageFromArray(N.astype('i2')), W, useCompression=True)",
    ),
]

# Who opens meshes: each gets W, and leaves V: how many vertices and triangles it counts, and the volume.
SOLIDS = """
def solid(p, t):
    import numpy as np
    p, t = np.asarray(p, float), np.asarray(t)
    p = p - p.mean(0)
    return [len(p), len(t), float(np.einsum('ij,ij->i', p[t[:, 0]], np.cross(p[t[:, 1]], p[t[:, 2]])).sum() / 6)]
"""
MESH_READERS = [
    *(
        ("trimesh", name, "import trimesh; m = trimesh.load(W, process=False, force='mesh'); V = solid(m.vertices, m.faces)")
        for name in ("a.ply", "a.obj", "a.glb", "double.ply", "double.obj", "beads.ply")
    ),
    *(
        ("meshio", name, "import meshio; m = meshio.read(W); V = solid(m.points, m.cells_dict['triangle'])")
        for name in ("a.ply", "a.obj", "double.ply", "double.obj")  # It cannot read numbers of faces.
    ),
    (
        "vtk",
        "a.ply",
        "import vtk; from vtk.util.numpy_support import vtk_to_numpy as n; r = vtk.vtkPLYReader(); r.SetFileName(W); "
        "r.Update(); o = r.GetOutput(); V = solid(n(o.GetPoints().GetData()), n(o.GetPolys().GetConnectivityArray()).reshape(-1, 3))",
    ),
    *(
        (
            "vtk",
            name,
            "import vtk; from vtk.util.numpy_support import vtk_to_numpy as n; r = vtk.vtkXMLPolyDataReader(); "
            "r.SetFileName(W); r.Update(); o = r.GetOutput(); "
            "V = solid(n(o.GetPoints().GetData()), n(o.GetPolys().GetConnectivityArray()).reshape(-1, 3))",
        )
        for name in ("a.vtp", "double.vtp", "beads.vtp")
    ),
    (
        "pyvista",
        "beads.vtp",
        "import pyvista; m = pyvista.read(W); V = solid(m.points, m.regular_faces); "
        "assert set(m.cell_data) == {'bead', 'layer', 'feature'} and m.cell_data['layer'].min() >= -1",
    ),
    (
        # Each triangle has its own corners there, and each corner the numbers of its triangle.
        "trimesh",
        "beads.glb",
        "import trimesh, pyvista, numpy as np; m = trimesh.load(W, process=False, force='mesh'); a = m.vertex_attributes; "
        "told = pyvista.read(W[:-3] + 'vtp').cell_data; assert set(told) == {'bead', 'layer', 'feature'}; "
        "assert all((a['_' + n.upper()].reshape(-1, 3) == np.asarray(told[n])[:, None]).all() for n in told); "
        "V = solid(m.vertices, m.faces); V[0] = len(np.unique(np.asarray(m.vertices), axis=0))",
    ),
    (
        "lib3mf",
        "a.3mf",
        "import lib3mf; from lib3mf import get_wrapper; model = get_wrapper().CreateModel(); "
        "model.QueryReader('3mf').ReadFromFile(W); i = model.GetMeshObjects(); i.MoveNext(); o = i.GetCurrentMeshObject(); "
        "V = solid([list(v.Coordinates) for v in o.GetVertices()], [list(t.Indices) for t in o.GetTriangleIndices()])",
    ),
]

# Who opens meshes as a program of its own: its command, with SCRIPT for a file of the code, the mesh, and the code.
PROGRAM_READERS = [
    (
        "ParaView",
        ["pvpython", "SCRIPT"],
        ["a.vtp", "double.vtp", "beads.vtp", "a.ply", "a.stl"],
        "from paraview import simple, servermanager; from vtkmodules.util.numpy_support import vtk_to_numpy as n; "
        "o = servermanager.Fetch(simple.OpenDataFile(W)); "
        "V = solid(n(o.GetPoints().GetData()), n(o.GetPolys().GetConnectivityArray()).reshape(-1, 3))",
    ),
    (
        "Blender",
        ["blender", "-b", "-P", "SCRIPT"],
        ["a.ply", "a.glb", "a.stl"],
        """
import sys
sys.path.append('/usr/lib/python3/dist-packages')
import bpy, numpy
numpy.bool = bool  # Blender 3.4 of Debian 12 reads .glb with a name that its NumPy 1.24 no longer has.
bpy.ops.wm.read_factory_settings(use_empty=True)
kind = W.rsplit('.', 1)[1]
{'ply': lambda: bpy.ops.import_mesh.ply(filepath=W), 'stl': lambda: bpy.ops.import_mesh.stl(filepath=W),
 'glb': lambda: bpy.ops.import_scene.gltf(filepath=W)}[kind]()
mesh = next(o for o in bpy.context.scene.objects if o.type == 'MESH')
place = mesh.matrix_world
V = solid([list(place @ v.co) for v in mesh.data.vertices], [list(p.vertices) for p in mesh.data.polygons])
""",
    ),
]

# Who opens meshes whose vertices have numbers: each gets W and NAME, and leaves V, the numbers.
NUMBER_READERS = [
    ("pyvista", "vtp", "import pyvista; V = pyvista.read(W).point_data[NAME]"),
    ("vtk", "vtp", "import vtk; from vtk.util.numpy_support import vtk_to_numpy as n; r = vtk.vtkXMLPolyDataReader(); "
     "r.SetFileName(W); r.Update(); V = n(r.GetOutput().GetPointData().GetArray(NAME))"),
    ("trimesh", "glb", "import trimesh; m = trimesh.load(W, process=False, force='mesh'); V = m.vertex_attributes['_' + NAME.upper()]"),
    ("trimesh", "ply", "import trimesh; m = trimesh.load(W, process=False); V = m.metadata['_ply_raw']['vertex']['data'][NAME]"),
]

# Who writes point clouds for `build`: each gets W and P (points of three numbers) and N (their normals), and leaves V, the points
# as it reads them back, in the unit that `build` reads them in.
LAS = """
import laspy
def las(form, version, normals):
    head = laspy.LasHeader(point_format=form, version=version)
    head.scales, head.offsets = [1e-4] * 3, [500000, 5000000, 0]
    if normals:
        for axis in "XYZ":
            head.add_extra_dim(laspy.ExtraBytesParams(name="Normal" + axis, type=np.float32))
    cloud = laspy.LasData(head)
    cloud.x, cloud.y, cloud.z = P.T
    if normals:
        cloud.NormalX, cloud.NormalY, cloud.NormalZ = N.T
    cloud.write(W)
    return np.asarray(laspy.read(W).xyz)
"""
CLOUD_WRITERS = [
    *(
        (f"laspy, format {form}", ending, LAS + f"V = las({form}, '{version}', {normals})")
        for form, version, ending, normals in [
            (0, "1.2", "las", False), (3, "1.2", "las", True), (1, "1.2", "laz", False), (3, "1.3", "laz", True),
            (6, "1.4", "las", True), (6, "1.4", "laz", True), (7, "1.4", "laz", False), (8, "1.4", "laz", False),
        ]
    ),
    (
        "copclib",
        "copc.laz",
        """
import copclib as c
config = c.CopcConfigWriter(6, c.Vector3(1e-4, 1e-4, 1e-4), c.Vector3(500000, 5000000, 0))
config.las_header.min, config.las_header.max = c.Vector3(*P.min(0)), c.Vector3(*P.max(0))
w = c.FileWriter(W, config)
head = w.copc_config.las_header
for n, key in enumerate([c.VoxelKey(0, 0, 0, 0), c.VoxelKey(1, 0, 0, 0)]):
    points = c.Points(head)
    for p in P[n::2]:
        point = points.CreatePoint()
        point.x, point.y, point.z = map(float, p)
        points.AddPoint(point)
    w.AddNode(key, points)
w.Close()
r = c.FileReader(W)
V = np.concatenate([np.stack([q.x, q.y, q.z], 1) for q in map(r.GetPoints, r.GetAllNodes())])
""",
    ),
    (
        "pye57, two scans",
        "e57",
        """
import pye57
file = pye57.E57(W, mode="w")
half, place = np.array([0.5, 0.5, 0.5, 0.5]), np.array([500000.0, 5000000, 0])
for n in range(2):
    # Turned so that x is y, y is z, and z is x.
    q = (P[n::2] - place)[:, [1, 2, 0]]
    file.write_scan_raw({"cartesianX": q[:, 0].copy(), "cartesianY": q[:, 1].copy(), "cartesianZ": q[:, 2].copy()}, rotation=half, translation=place)
file.close()
file = pye57.E57(W)
V = np.concatenate([np.stack([s[k] for k in ("cartesianX", "cartesianY", "cartesianZ")], 1) for s in (file.read_scan(n, ignore_missing_fields=True) for n in range(2))]) * 1000
""",
    ),
]


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
    (folder / "reader.py").write_text(script)
    subprocess.run([str(python), folder / "reader.py"], check=True, capture_output=True, text=True)
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
            lines = error.stderr.strip().splitlines() or ["it ended with status %d" % error.returncode]
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


def written(program, folder, pythons):
    """A line for each writer of volumes; returns whether all samples come back."""
    chance, axis, agreed = random.Random(2), (41, 37, 50), True
    blobs = [([chance.uniform(5, n - 5) for n in axis], chance.uniform(3, 9)) for _ in range(9)]
    values = [
        min(3, sum(sum((c - m) ** 2 for c, m in zip((x, y, z), middle)) < r * r for middle, r in blobs))
        for z in range(axis[2])
        for y in range(axis[1])
        for x in range(axis[0])
    ]
    # An empty border, so that nothing is cut.
    inside = lambda n: all(0 < c < m - 1 for c, m in zip((n % 41, n // 41 % 37, n // 41 // 37), axis))
    values = [v if inside(n) else 0 for n, v in enumerate(values)]
    (folder / "numbers.json").write_text(json.dumps(values))
    for name, ending, where, code in WRITERS:
        python, reason = pythons[where]
        if python is None:
            print(f"{name:22} .{ending:7} NOT HERE: {reason}")
            continue
        path, store = folder / f"n.{ending}", folder / "n.brf"
        script = (
            f"import json, numpy as np\nW = {str(path)!r}\n"
            f"N = np.array(json.load(open({str(folder / 'numbers.json')!r}))).reshape(50, 37, 41)\n{code}\n"
        )
        try:
            subprocess.run([str(python), "-c", script], check=True, capture_output=True, text=True)
        except subprocess.CalledProcessError as error:
            print(f"{name:22} .{ending:7} NOT HERE: {error.stderr.strip().splitlines()[-1]}")
            continue
        run(program, "build", path, "-o", store, "--quiet")
        chosen = [n for n, v in enumerate(values) if v > 0]
        chosen += [chance.randrange(len(values)) for _ in range(POINTS)]
        points = "".join(f"{n % 41},{n // 41 % 37},{n // 41 // 37}\n" for n in chosen)
        answer = run(program, "sample", store, "--points", "-", input="x,y,z\n" + points).splitlines()[1:]
        wrong = sum(float(line.rsplit(",", 1)[1]) != values[n] for line, n in zip(answer, chosen))
        agreed &= wrong == 0 and len(answer) == len(chosen)
        print(f"{name:22} .{ending:7} written, built: {len(answer)} samples, {wrong} differ; {path.stat().st_size:,} bytes")
        path.unlink()
        store.unlink()
    return agreed


def meshes(program, folder, python):
    """A line for each reader of meshes; returns whether all count and measure what `mesh` tells."""
    store, agreed, told = folder / "beads.brf", True, {}
    run(program, "build", HERE / "clover.gcode", "-o", store, "--depth", "2", "--identity", "--quiet")
    more = {"double": ["--double"], "beads": ["--attributes", "bead,layer,feature"]}
    for name in sorted({name for _, name, _ in MESH_READERS} | {n for _, _, names, _ in PROGRAM_READERS for n in names}):
        options = more.get(name.split(".")[0], [])
        told[name] = json.loads(run(program, "mesh", store, "-o", folder / name, "--json", *options))
    for reader, name, code in MESH_READERS:
        script = f"import json\nW = {str(folder / name)!r}\n{SOLIDS}\n{code}\nprint(json.dumps(V))\n"
        try:
            vertices, triangles, volume = json.loads(run(python, "-c", script).splitlines()[-1])
        except subprocess.CalledProcessError as error:
            print(f"{reader:22} {name:12} {error.stderr.strip().splitlines()[-1]}")
            agreed = False
            continue
        wanted = told[name]
        scale = 1e9 if name.endswith("glb") else 1.0
        off = abs(volume * scale / wanted["volume"] - 1)
        is_same = (vertices, triangles) == (wanted["vertices"], wanted["triangles"]) and off < 1e-6
        agreed &= is_same
        print(f"{reader:22} {name:12} {vertices:,} vertices, {triangles:,} triangles, volume off by {off:.1e}: {'same' if is_same else 'DIFFERS'}")
    return programs(folder, told) and agreed


def programs(folder, told):
    """A line for each program that opens meshes; returns whether all count and measure what `mesh` tells."""
    agreed = True
    for reader, command, names, code in PROGRAM_READERS:
        for name in names:
            if not shutil.which(command[0]):
                print(f"{reader:22} {name:12} NOT HERE: no such program as {command[0]}")
                continue
            script, result = folder / "reader.py", folder / "solid.json"
            result.unlink(missing_ok=True)
            script.write_text(f"import json\nW = {str(folder / name)!r}\n{SOLIDS}\n{code}\njson.dump(V, open({str(result)!r}, 'w'))\n")
            ended = subprocess.run([script if word == "SCRIPT" else word for word in command], capture_output=True, text=True)
            if not result.exists():
                lines = (ended.stdout + ended.stderr).strip().splitlines()
                wrong = [line for line in lines if "Error" in line] or lines
                print(f"{reader:22} {name:12} {wrong[-1]}")
                agreed = False
                continue
            vertices, triangles, volume = json.loads(result.read_text())
            wanted = told[name]
            scale = 1e9 if name.endswith("glb") else 1.0
            off = abs(volume * scale / wanted["volume"] - 1)
            # A .stl has no shared vertices, and readers join what lies at one place.
            is_same = triangles == wanted["triangles"] and off < 1e-6
            is_same &= name.endswith("stl") or vertices == wanted["vertices"]
            agreed &= is_same
            print(f"{reader:22} {name:12} {vertices:,} vertices, {triangles:,} triangles, volume off by {off:.1e}: {'same' if is_same else 'DIFFERS'}")
    return agreed


def numbers(program, folder, python):
    """A line for each reader of numbers of vertices; returns whether all read what `thickness` and `deviation` tell."""
    store, agreed = folder / "numbers.brf", True
    run(program, "build", HERE / "clover.gcode", "-o", store, "--depth", "2", "--quiet")
    run(program, "mesh", store, "-o", folder / "reference.stl", "--level", "1", "--quiet")
    for name, more in [("thickness", []), ("deviation", [folder / "reference.stl"])]:
        for reader, ending, code in NUMBER_READERS:
            path = folder / f"{name}.{ending}"
            told = json.loads(run(program, name, store, *more, "-o", path, "--json"))
            script = (
                f"import json, numpy as np\nW, NAME = {str(path)!r}, {name!r}\n{code}\nV = np.asarray(V, float).ravel()\n"
                f"V = np.where(np.isfinite(V) & ((V != -1) | (NAME != 'thickness')), V, np.nan)\n"
                "print(json.dumps([len(V), int(np.isfinite(V).sum()), float(np.nanmin(V)), float(np.nanmax(V))]))\n"
            )
            count, finite, low, high = json.loads(run(python, "-c", script).splitlines()[-1])
            is_same = count == told["vertices"]
            if name == "thickness":
                is_same &= finite == told["measured"] and abs(low - told["min"]) < told["cell"] / 100
            agreed &= is_same
            print(f"{reader:22} {path.name:14} {count:,} numbers, {finite:,} finite, {low:.4g} to {high:.4g}: {'same' if is_same else 'DIFFERS'}")
    return agreed


def clouds(program, folder, python):
    """A line for each writer of point clouds; returns whether `info` finds its points, and `winding` the same of the file as of
    text with what the writer reads back."""
    agreed, text = True, folder / "cloud.xyz"
    points = (
        "import json, numpy as np\ni = np.arange(4000)\nz = 1 - 2 * (i + .5) / len(i)\nr = np.sqrt(1 - z * z)\n"
        "N = np.stack([r * np.cos(2.399963 * i), r * np.sin(2.399963 * i), z], 1)\nP = 2 * N + [500123.25, 5000456.5, 120]\n"
    )
    places = "".join(f"{500123.25 + 0.9 * n % 4 - 2},{5000456.5 + 0.37 * n % 4 - 2},{118 + 0.11 * n % 4}\n" for n in range(100))
    for writer, ending, code in CLOUD_WRITERS:
        path = folder / f"cloud.{ending}"
        script = f"{points}W = {str(path)!r}\n{code}\nnp.savetxt({str(text)!r}, V, fmt='%.9f')\n"
        try:
            run(python, "-c", script)
        except subprocess.CalledProcessError as error:
            print(f"{writer:22} .{ending:8} NOT HERE: {error.stderr.strip().splitlines()[-1]}")
            continue
        told = json.loads(run(program, "info", path, "--json"))
        read = json.loads(run(program, "info", text, "--json"))
        off = max(abs(a - b) for ends in zip(told["bounds"], read["bounds"]) for a, b in zip(*ends))
        is_same = told["points"] == read["points"] == 4000 and off < 1e-6
        scale = 1000 if ending == "e57" else 1
        asked = "".join(",".join(str(scale * float(c)) for c in line.split(",")) + "\n" for line in places.splitlines())
        answers = [
            [float(line.rsplit(",", 1)[1]) for line in run(program, "winding", file, "--points", "-", "--estimate-normals", input=asked).splitlines()[1:]]
            for file in (path, text)
        ]
        differ = max(abs(a - b) for a, b in zip(*answers))
        is_same &= differ < 1e-3 and len(answers[0]) == 100
        agreed &= is_same
        print(f"{writer:22} .{ending:8} {told['points']:,} points, bounds off by {off:.0e}, w by {differ:.0e}: {'same' if is_same else 'DIFFERS'}")
        path.unlink()
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
            "paraview": (shutil.which("pvpython"), "no such program as pvpython"),
        }
        agreed = compare(args.program, store, folder, pythons)
        agreed &= written(args.program, folder, pythons)
        if pythons["env"][0] is not None:
            agreed &= meshes(args.program, folder, pythons["env"][0])
            agreed &= numbers(args.program, folder, pythons["env"][0])
            agreed &= clouds(args.program, folder, pythons["env"][0])
        return 0 if agreed else 1


if __name__ == "__main__":
    sys.exit(main())
