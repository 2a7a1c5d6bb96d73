"""One question to one peer, in a process of its own: what `brickfield bench --peers` runs.

    python peers.py PEER QUESTION.json

QUESTION holds, as the peer needs them, `soup` (binary STL), `origin`, `spacing` and `samples` of a cubic grid, the flat
indices [z,y,x] of samples to be judged (`check`), a dense array (`array`, .npy), the facets of each piece of the soup
(`piece`), cells along its longest side (`cells`), threads (`threads`), and a file for the mesh (`mesh`, .ply). Prints JSON:
seconds (reading the file and welding vertices apart), version, and values or triangles and volume. A peer that is missing,
or cannot answer, ends with one line on standard error.

Fields that are contoured are signed distances in cells, negative inside and cut off at three, and mapped from their file, so
that memory is told without them. `distance-field` makes such a one of a closed mesh (`mesh`, .ply or .stl), or of the pieces
of a soup that hang together (`soup`), added or, if they are inside out, taken away.
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


def program_of(name):
    """A compiled program, which `setup` puts beside this Python; one on the path will do."""
    beside = os.path.dirname(sys.executable)
    program = shutil.which(name, path=os.pathsep.join([beside, os.environ.get("PATH", "")]))
    if program is None:
        raise ImportError(f"No program named '{name}'")
    return program


def openvdb_union(question):
    """The program of openvdb_union.cpp."""
    mesh = pathlib.Path("openvdb.stl")
    asked = [program_of("openvdb_union"), question["soup"], str(question["cells"]), str(question["threads"]), str(mesh)]
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


# Distances of fields, in cells, are cut off beyond.
BAND = 3


def read_mesh(path):
    """Vertices and corners of a binary PLY as Brickfield writes it, or of a binary STL."""
    if path.endswith(".stl"):
        return weld(read_soup(path))
    with open(path, "rb") as file:
        counts = []
        while (line := file.readline().split()) != [b"end_header"]:
            if line[:1] == [b"element"]:
                counts.append(int(line[2]))
        vertices = np.fromfile(file, "<f4", 3 * counts[0]).reshape(-1, 3)
        corners = np.fromfile(file, FACE, counts[1])["corners"]
    return vertices.astype(np.float64), corners.astype(np.int64)


FACE = np.dtype([("count", "u1"), ("corners", "<u4", 3)])


def write_ply(path, vertices, corners):
    faces = np.zeros(len(corners), FACE)
    faces["count"], faces["corners"] = 3, corners
    head = f"element vertex {len(vertices)}\n" + "".join(f"property float {axis}\n" for axis in "xyz")
    head += f"element face {len(corners)}\nproperty list uchar int vertex_indices\n"
    with open(path, "wb") as file:
        file.write(f"ply\nformat binary_little_endian 1.0\n{head}end_header\n".encode())
        file.write(np.ascontiguousarray(vertices, "<f4").tobytes() + faces.tobytes())


def distances_of(corners, vertices, spacing, origin, shape):
    """Signed distances to a closed mesh in cells, samples [z,y,x] of a grid, right up to the band and beyond it."""
    import trueform

    asked = {"dims": shape[::-1], "spacing": [spacing] * 3, "origin": list(origin)}
    mesh = corners.astype(np.int32), vertices.astype(np.float32)
    return trueform.mesh_sdf(mesh, mode="banded", band=BAND + 1, **asked).samples.T / np.float32(spacing)


def distance_field(question):
    origin, spacing = np.array(question["origin"]), question["spacing"]
    side = question["samples"]
    if "mesh" in question:
        vertices, corners = read_mesh(question["mesh"])
        field = distances_of(corners, vertices, spacing, origin, [side] * 3)
    else:
        field = of_pieces(weld(read_soup(question["soup"])), origin, spacing, side)
    np.save(question["array"], np.clip(field, -BAND, BAND))
    return {"seconds": 0}


def of_pieces(soup, origin, spacing, side):
    """Minimum over the pieces that point outward, maximum with the others: each asked for in its own box of samples."""
    import igl

    vertices, corners = soup
    label = igl.facet_components(corners)
    label = label[1] if isinstance(label, tuple) else label
    pieces = [corners[label == n] for n in range(label.max() + 1)]
    pieces = sorted(((piece, volume_of(vertices[piece]) > 0) for piece in pieces), key=lambda piece: not piece[1])
    field = np.full([side] * 3, BAND, np.float32)
    for piece, is_added in pieces:
        points = vertices[piece].reshape(-1, 3)
        low = np.maximum(np.floor((points.min(axis=0) - origin) / spacing).astype(int) - BAND - 1, 0)
        high = np.minimum(np.ceil((points.max(axis=0) - origin) / spacing).astype(int) + BAND + 2, side)
        box = tuple(slice(a, b) for a, b in zip(low[::-1], high[::-1]))
        shape = [b - a for a, b in zip(low[::-1], high[::-1])]
        piece = piece if is_added else piece[:, ::-1]
        own = distances_of(piece, vertices, spacing, origin + low * spacing, shape)
        field[box] = np.minimum(field[box], own) if is_added else np.maximum(field[box], -own)
    return field


def contoured(question, name, contour):
    """Times `contour` of the question's field, which gives corners and vertices in units of the grid."""
    begun = time.process_time()
    seconds, (corners, vertices) = timed(contour)
    told = {"seconds": seconds, "cpu_seconds": time.process_time() - begun, "version": name}
    if "mesh" in question:
        write_ply(question["mesh"], vertices, corners)
    return told | {"triangles": len(corners)}


def mapped_field(question):
    """With all of its pages in memory."""
    field = np.load(question["array"], mmap_mode="c")
    field.max()
    return field


def trueform_contour(method, question):
    import trueform

    spacing, origin = [question["spacing"]] * 3, question["origin"]
    volume = trueform.Volume(np.asarray(mapped_field(question)).T, spacing=spacing, origin=origin)
    return contoured(question, version("trueform"), lambda: trueform.isosurface(volume, 0.0, method=method))


def vtk_contour(question):
    import vtk
    from vtk.util.numpy_support import numpy_to_vtk, vtk_to_numpy

    field = mapped_field(question)
    image = vtk.vtkImageData()
    image.SetDimensions(*field.shape[::-1])
    image.SetSpacing(*[question["spacing"]] * 3)
    image.SetOrigin(*question["origin"])
    image.GetPointData().SetScalars(numpy_to_vtk(np.asarray(field).ravel()))
    vtk.vtkSMPTools.Initialize(question["threads"])
    edges = vtk.vtkFlyingEdges3D()
    edges.SetInputData(image)
    edges.SetValue(0, 0.0)
    edges.ComputeNormalsOff()
    edges.ComputeScalarsOff()

    def contour():
        edges.Update()
        mesh = edges.GetOutput()
        corners = vtk_to_numpy(mesh.GetPolys().GetConnectivityArray()).reshape(-1, 3)
        return corners, vtk_to_numpy(mesh.GetPoints().GetData())

    return contoured(question, vtk.vtkVersion.GetVTKVersion(), contour)


def openvdb_contour(question):
    """The program of openvdb_contour.cpp in the place of this one, so that its memory is told."""
    grid = [question["array"], question["spacing"], *question["origin"]]
    rest = [question["adaptivity"], question["threads"], *([question["mesh"]] if "mesh" in question else [])]
    become([program_of("openvdb_contour"), *grid, *rest])


def fidget_contour(question):
    """The program of `fidget`, for which the soup becomes a function."""
    depth = question["cells"].bit_length() - 1
    rest = [question["mesh"]] if "mesh" in question else []
    become([program_of("fidget-contour"), question["soup"], depth, *rest])


def become(words):
    sys.stdout.flush()
    os.execv(words[0], [str(word) for word in words])


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
    "distance-field": distance_field,
    "trueform-edges": functools.partial(trueform_contour, "flying_edges"),
    "trueform-dual": functools.partial(trueform_contour, "dual_contouring"),
    "vtk-contour": vtk_contour,
    "openvdb-contour": openvdb_contour,
    "fidget-contour": fidget_contour,
}


def main():
    if len(sys.argv) != 3 or sys.argv[1] not in PEERS:
        raise SystemExit(f"usage: peers.py {'|'.join(PEERS)} QUESTION.json")
    with open(sys.argv[2]) as file:
        question = json.load(file)
    if "threads" in question:
        # Before any thread is started: libraries count the processors that they may run on.
        os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[: question["threads"]])
    try:
        told = PEERS[sys.argv[1]](question)
    except ImportError as missing:
        raise SystemExit(f"not installed: {missing}") from None
    except Exception as error:
        raise SystemExit(f"{type(error).__name__}: {str(error).splitlines()[0] if str(error) else ''}") from None
    json.dump(told, sys.stdout)


if __name__ == "__main__":
    main()
