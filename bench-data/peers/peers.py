"""One question to one peer, in a process of its own: what `brickfield bench --peers` runs.

    python peers.py PEER QUESTION.json

QUESTION holds `soup` (binary STL) and, as the peer needs them, `origin`, `spacing` and `samples` of a cubic grid, the
flat indices [z,y,x] of samples to be judged (`check`), a dense array (`array`, .npy), the facets of each piece of
the soup (`piece`), cells along its longest side (`cells`) and threads (`threads`). Prints JSON: seconds (reading the file and welding vertices apart), version, and values or
triangles and volume. A peer that is missing, or cannot answer, ends with one line on standard error.
"""

import functools
import json
import operator
import os
import pathlib
import shutil
import subprocess
import sys
import time
from importlib.metadata import version

import numpy as np


def read_soup(path):
    record = np.dtype([("normal", "<f4", 3), ("facet", "<f4", (3, 3)), ("attribute", "<u2")])
    with open(path, "rb") as file:
        count = int(np.frombuffer(file.read(84), "<u4", 1, 80)[0])
        return np.fromfile(file, record, count)["facet"].astype(np.float64)


def weld(facets):
    vertices, corners = np.unique(facets.reshape(-1, 3), axis=0, return_inverse=True)
    return vertices, corners.reshape(-1, 3).astype(np.int64)


def grid(question):
    at = np.arange(question["samples"]) * question["spacing"]
    x, y, z = (question["origin"][a] + at for a in range(3))
    z, y, x = np.meshgrid(z, y, x, indexing="ij")
    return np.column_stack([x.ravel(), y.ravel(), z.ravel()])


def timed(work):
    start = time.perf_counter()
    done = work()
    return time.perf_counter() - start, done


def volume_of(facets):
    return float(np.einsum("ij,ij->i", facets[:, 0], np.cross(facets[:, 1], facets[:, 2])).sum() / 6)


def libigl_fast(question):
    import igl

    vertices, corners = weld(read_soup(question["soup"]))
    points = grid(question)
    seconds, w = timed(lambda: igl.fast_winding_number(vertices, corners, points))
    return {"seconds": seconds, "version": version("libigl"), "values": w[question["check"]].tolist()}


def libigl_exact(question):
    import igl

    vertices, corners = weld(read_soup(question["soup"]))
    points = grid(question)[question["check"]]
    seconds, w = timed(lambda: igl.winding_number(vertices, corners, points))
    return {"seconds": seconds, "version": version("libigl"), "values": w.tolist(), "of": len(points)}


def meshlib_fast(question):
    from meshlib import mrmeshnumpy, mrmeshpy

    vertices, corners = weld(read_soup(question["soup"]))
    mesh = mrmeshnumpy.meshFromFacesVerts(corners.astype(np.int32), vertices.astype(np.float32))
    side, step = question["samples"], question["spacing"]
    to_world = mrmeshpy.AffineXf3f()
    to_world.A = mrmeshpy.Matrix3f.scale(step)
    to_world.b = mrmeshpy.Vector3f(*question["origin"])

    def ask():
        answered = mrmeshpy.std_vector_float()
        dims = mrmeshpy.Vector3i(side, side, side)
        mrmeshpy.FastWindingNumber(mesh).calcFromGrid(answered, dims, to_world, 2.0, lambda share: True)
        return answered

    seconds, w = timed(ask)
    return {"seconds": seconds, "version": version("meshlib"), "values": [w[i] for i in question["check"]]}


def trueform_fast(question):
    import trueform

    vertices, corners = weld(read_soup(question["soup"]))
    points = trueform.Point(grid(question))

    def ask():
        return trueform.winding_number(trueform.Mesh(corners, vertices), points)

    seconds, w = timed(ask)
    return {"seconds": seconds, "version": version("trueform"), "values": w[question["check"]].tolist()}


def open3d_occupancy(question):
    import open3d

    vertices, corners = weld(read_soup(question["soup"]))
    points = open3d.core.Tensor(grid(question).astype(np.float32))

    def ask():
        scene = open3d.t.geometry.RaycastingScene()
        scene.add_triangles(vertices.astype(np.float32), corners.astype(np.uint32))
        return scene.compute_occupancy(points).numpy()

    seconds, inside = timed(ask)
    return {"seconds": seconds, "version": open3d.__version__, "values": inside[question["check"]].tolist()}


def skimage_cubes(question):
    from skimage.measure import marching_cubes

    dense = np.load(question["array"])
    seconds, (vertices, corners, *_) = timed(lambda: marching_cubes(dense, 0.5))
    facets = vertices[corners][:, :, ::-1] * question["spacing"]
    volume = abs(volume_of(facets))
    return {"seconds": seconds, "version": version("scikit-image"), "triangles": len(corners), "volume": volume}


def vtk_edges(question):
    import vtk
    from vtk.util.numpy_support import numpy_to_vtk, vtk_to_numpy

    dense = np.load(question["array"])
    image = vtk.vtkImageData()
    image.SetDimensions(*dense.shape[::-1])
    image.SetSpacing(*[question["spacing"]] * 3)
    image.GetPointData().SetScalars(numpy_to_vtk(dense.ravel()))
    edges = vtk.vtkFlyingEdges3D()
    edges.SetInputData(image)
    edges.SetValue(0, 0.5)
    edges.ComputeNormalsOff()
    seconds, _ = timed(edges.Update)
    mesh = edges.GetOutput()
    vertices = vtk_to_numpy(mesh.GetPoints().GetData()).astype(np.float64)
    corners = vtk_to_numpy(mesh.GetPolys().GetConnectivityArray()).reshape(-1, 3)
    volume = abs(volume_of(vertices[corners]))
    return {"seconds": seconds, "version": vtk.vtkVersion.GetVTKVersion(), "triangles": len(corners), "volume": volume}


def manifold_union(question):
    import manifold3d

    facets = read_soup(question["soup"])
    pieces = [weld(facets[i : i + question["piece"]]) for i in range(0, len(facets), question["piece"])]

    def unite():
        meshes = (manifold3d.Mesh(v.astype(np.float32), c.astype(np.uint32)) for v, c in pieces)
        solids = [manifold3d.Manifold(mesh) for mesh in meshes]
        union = manifold3d.Manifold.batch_boolean(solids, manifold3d.OpType.Add)
        return union, union.num_tri()  # evaluated only when asked for

    seconds, (union, triangles) = timed(unite)
    volume = union.volume()
    return {"seconds": seconds, "version": version("manifold3d"), "triangles": triangles, "volume": volume}


def trueform_union(question):
    import trueform

    facets = read_soup(question["soup"])
    pieces = [weld(facets[i : i + question["piece"]]) for i in range(0, len(facets), question["piece"])]

    def unite():
        graph = trueform.CsgGraph([trueform.Mesh(corners, vertices) for vertices, corners in pieces])
        return graph.mesh(functools.reduce(operator.or_, map(trueform.op, range(len(pieces)))))

    seconds, (corners, vertices) = timed(unite)
    volume = abs(volume_of(vertices[corners]))
    return {"seconds": seconds, "version": version("trueform"), "triangles": len(corners), "volume": volume}


def openvdb_union(question):
    """The program of openvdb_union.cpp, which `setup` puts beside this Python; one on the path will do."""
    beside = os.path.dirname(sys.executable)
    program = shutil.which("openvdb_union", path=os.pathsep.join([beside, os.environ.get("PATH", "")]))
    if program is None:
        raise ImportError("No program named 'openvdb_union'")
    mesh = pathlib.Path("openvdb.stl")
    asked = [program, question["soup"], str(question["cells"]), str(question["threads"]), str(mesh)]
    done = subprocess.run(asked, capture_output=True, text=True)
    if done.returncode != 0:
        raise RuntimeError((done.stderr.splitlines() or [f"exit status {done.returncode}"])[-1])
    told = json.loads(done.stdout)
    volume = abs(volume_of(read_soup(mesh)))
    mesh.unlink()
    return {
        "seconds": told["voxels_s"] + told["mesh_s"],
        "version": told["openvdb"],
        "triangles": told["triangles"],
        "volume": volume,
        "anonymous_bytes": 0,  # Python's own would be told for it
    }


PEERS = {
    "libigl-fast": libigl_fast,
    "libigl-exact": libigl_exact,
    "meshlib-fast": meshlib_fast,
    "trueform-fast": trueform_fast,
    "open3d-occupancy": open3d_occupancy,
    "skimage-cubes": skimage_cubes,
    "vtk-edges": vtk_edges,
    "manifold-union": manifold_union,
    "trueform-union": trueform_union,
    "openvdb-union": openvdb_union,
}


def main():
    if len(sys.argv) != 3 or sys.argv[1] not in PEERS:
        raise SystemExit(f"usage: peers.py {'|'.join(PEERS)} QUESTION.json")
    with open(sys.argv[2]) as file:
        question = json.load(file)
    try:
        told = PEERS[sys.argv[1]](question)
    except ImportError as missing:
        raise SystemExit(f"not installed: {missing}") from None
    except Exception as error:
        raise SystemExit(f"{type(error).__name__}: {str(error).splitlines()[0] if str(error) else ''}") from None
    json.dump(told, sys.stdout)


if __name__ == "__main__":
    main()
