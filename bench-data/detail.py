#!/usr/bin/env python3
"""Meshes of a size asked for: triangles, volume, distances and time, beside decimation of the fine mesh.

    python3 -m venv venv && venv/bin/pip install numpy fast-simplification meshoptimizer pymeshlab meshlib
    venv/bin/python bench-data/detail.py --program target/release/brickfield STORE.brf... --triangles 10000 100000
    ... --peers                      # decimates the fine mesh of each store, too; names after it are the peers to ask
    ... --peers --cgal cgal_simplify # also by CGAL: bench-data/peers/cgal_simplify.cpp says how to compile it
    venv/bin/python bench-data/detail.py --tetrahedra MESH.stl    # needs `pip install gmsh`
    venv/bin/python bench-data/detail.py --tetrahedra MESH.ply --others  # needs `pip install tetgen pytetwild pyvista`

Stores are made by `brickfield build`. Prints tables; exit status 1 if a mesh of ours is not sound or not of the size asked for.
"""

import argparse
import contextlib
import json
import pathlib
import subprocess
import sys
import tempfile
import time


def run(program, *arguments):
    """What the program prints as JSON, and its status; errors end this one."""
    done = subprocess.run([program, *map(str, arguments), "--json"], capture_output=True, text=True)
    if not done.stdout:
        sys.exit(f"{' '.join(map(str, arguments))}: {done.stderr.strip()}")
    return json.loads(done.stdout)


def ours(program, store, most, folder):
    """A row of a mesh of at most so many triangles."""
    out = folder / "ours.ply"
    began = time.time()
    made = run(program, "mesh", store, "-o", out, "--triangles", most, "--check")
    seconds = time.time() - began
    there, back = made["detail"]["distances"] or [None, None]
    is_right = made["check"]["sound"] and 0.9 * most <= made["triangles"] <= most
    cell = made["detail"]["cell"]
    print(
        f"| {store.stem} | {most:,} | {made['triangles']:,} | {cell:.3f} | {made['detail']['tolerance']:.3f} "
        f"| {100 * (made['volume'] / made['expected']['volume'] - 1):+.3f} ± {100 * made['expected']['error'] / made['expected']['volume']:.2f} "
        + (f"| {there['of_999']:.2f} ({there['of_999'] / cell:.2f}) | {back['mean']:.2f} | {100 * back['beyond']:.1f} " if there else "| | | ")
        + f"| {'sound' if made['check']['sound'] else 'NOT SOUND'} | {seconds:.1f} |",
        flush=True,
    )
    return is_right


def read_ply(path):
    """Positions and triangles of a PLY as the program writes it."""
    import numpy as np

    data = path.read_bytes()
    end = data.index(b"end_header\n") + len(b"end_header\n")
    counts = [int(line.split()[2]) for line in data[:end].decode().splitlines() if line.startswith("element")]
    positions = np.frombuffer(data, "<f4", 3 * counts[0], end).reshape(-1, 3)
    faces = np.frombuffer(data, np.dtype([("n", "u1"), ("ids", "<u4", 3)]), counts[1], end + positions.nbytes)
    return positions.copy(), faces["ids"].astype(np.uint32)


def write_ply(path, positions, triangles):
    import numpy as np

    faces = np.empty(len(triangles), np.dtype([("n", "u1"), ("ids", "<u4", 3)]))
    faces["n"], faces["ids"] = 3, triangles
    header = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(positions)}\nproperty float x\nproperty float y\n"
        f"property float z\nelement face {len(triangles)}\nproperty list uchar uint vertex_indices\nend_header\n"
    )
    path.write_bytes(header.encode() + np.asarray(positions, "<f4").tobytes() + faces.tobytes())


def fast_simplification(positions, triangles, most):
    import fast_simplification as peer

    return peer.simplify(positions, triangles.astype("int64"), target_count=most)


def meshoptimizer(positions, triangles, most):
    import meshoptimizer as peer
    import numpy as np

    indices = np.ascontiguousarray(triangles.reshape(-1), dtype=np.uint32)
    out = np.zeros_like(indices)
    count = peer.simplify(
        out, indices, np.ascontiguousarray(positions, dtype=np.float32), target_index_count=3 * most, target_error=1e9
    )
    return positions, out[:count].reshape(-1, 3)


def pymeshlab(positions, triangles, most):
    import pymeshlab as peer

    meshes = peer.MeshSet()
    meshes.add_mesh(peer.Mesh(positions.astype(float), triangles.astype("int32")))
    meshes.meshing_decimation_quadric_edge_collapse(targetfacenum=most, preservetopology=True, optimalplacement=True)
    mesh = meshes.current_mesh()
    return mesh.vertex_matrix(), mesh.face_matrix()


def meshlib(positions, triangles, most):
    from meshlib import mrmeshnumpy, mrmeshpy

    mesh = mrmeshnumpy.meshFromFacesVerts(triangles.astype("int32"), positions)
    settings = mrmeshpy.DecimateSettings()
    settings.maxDeletedFaces = len(triangles) - most
    settings.maxError = 1e9
    settings.packMesh = True
    mrmeshpy.decimateMesh(mesh, settings)
    return mrmeshnumpy.getNumpyVerts(mesh), mrmeshnumpy.getNumpyFaces(mesh.topology)


def cgal(program, cost):
    """CGAL's simplification with one of its costs, as a peer."""

    def peer(positions, triangles, most):
        with tempfile.TemporaryDirectory() as folder:
            fine, coarse = pathlib.Path(folder) / "fine.ply", pathlib.Path(folder) / "coarse.ply"
            write_ply(fine, positions, triangles)
            subprocess.run([program, fine, str(most), cost, coarse], check=True, stdout=subprocess.DEVNULL)
            return read_ply(coarse)

    peer.__name__ = f"CGAL, {cost}"
    return peer


def apart(program, store, mesh, folder):
    """Distances of the store's surface to a mesh, rms and within which 99.8 % lie, and those of the mesh to the surface."""
    told = run(program, "deviation", store, mesh, "-o", folder / "apart.ply")

    def of(way):
        ends = told[way]["percentiles"]
        return f"{told[way]['rms']:.3f}, {max(abs(ends['0.1']), abs(ends['99.9'])):.2f}"

    return " | ".join(of(way) for way in ("part_to_reference", "reference_to_part"))


def peers(program, store, most, fine, folder, asked):
    """Rows of our mesh and of the fine mesh as the peers that are asked decimate it."""
    out = folder / "ours.ply"
    made = run(program, "mesh", store, "-o", out, "--triangles", most, "--check")
    expected = made["expected"]["volume"]
    print(
        f"| {store.stem} | {most:,} | Brickfield | {made['triangles']:,} | {100 * (made['volume'] / expected - 1):+.2f} "
        f"| {'sound' if made['check']['sound'] else 'NOT SOUND'} | 0 | {apart(program, store, out, folder)} | {made['seconds']:.1f} |",
        flush=True,
    )
    positions, triangles = fine
    for peer in asked:
        began = time.time()
        try:
            result = peer(positions, triangles, most)
        except Exception as error:  # A peer that is missing or fails has a row that says so.
            print(f"| {store.stem} | {most:,} | {peer.__name__} | {error} |")
            continue
        seconds = time.time() - began
        out = folder / "peer.ply"
        write_ply(out, *result)
        check = run(program, "mesh", "--check", out, "--weld")
        pairs = check["intersections"]["pairs"]
        closed = "closed" if check["closed"] else "open"
        manifold = "manifold" if check["edge_manifold"] and check["vertex_manifold"] else "not manifold"
        volume = f"{100 * (check['volume'] / expected - 1):+.2f}" if check["volume"] is not None else "none"
        print(
            f"| {store.stem} | {most:,} | {peer.__name__} | {len(result[1]):,} | {volume} | {closed}, {manifold} "
            f"| {pairs} | {apart(program, store, out, folder)} | {seconds:.1f} |",
            flush=True,
        )


def tetrahedra(path):
    """Tetrahedra within a closed mesh, by Gmsh, as it is."""
    import gmsh

    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    began = time.time()
    gmsh.merge(str(path))
    gmsh.model.mesh.createTopology()
    surfaces = [tag for _, tag in gmsh.model.getEntities(2)]
    gmsh.model.geo.addVolume([gmsh.model.geo.addSurfaceLoop(surfaces)])
    gmsh.model.geo.synchronize()
    gmsh.model.mesh.generate(3)
    kinds, tags, _ = gmsh.model.mesh.getElements(3)
    count = sum(len(of_kind) for of_kind in tags)
    quality = gmsh.model.mesh.getElementQualities(tags[0], "gamma")
    volume = sum(gmsh.model.mesh.getElementQualities(tags[0], "volume"))
    print(
        f"{path}: {count} tetrahedra in {time.time() - began:.1f} s, volume {volume:.3f}, gamma at least {min(quality):.2g}, "
        f"mean {sum(quality) / len(quality):.2f}"
    )
    gmsh.write(str(pathlib.Path(path).with_suffix(".msh")))
    gmsh.finalize()


def tetrahedra_of_others(path):
    """Tetrahedra within a closed mesh with shared vertices, by TetGen, as it is, and by fTetWild, within its envelope."""
    import numpy as np
    import pytetwild
    import pyvista
    import tetgen

    mesh = pyvista.read(path)
    began = time.time()
    points, cells = tetgen.TetGen(mesh).tetrahedralize(order=1, mindihedral=0, minratio=2.0)[:2]
    corners = [points[cells[:, n]] for n in range(4)]
    sides = [corner - corners[0] for corner in corners[1:]]
    volume = abs((np.cross(sides[0], sides[1]) * sides[2]).sum(axis=1)).sum() / 6
    print(f"{path}: TetGen: {len(cells)} tetrahedra in {time.time() - began:.1f} s, volume {volume:.3f} of {mesh.volume:.3f}")
    began = time.time()
    # It leaves files where it runs.
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        found = pytetwild.tetrahedralize_pv(mesh, edge_length_fac=0.03, quiet=True)
    print(f"{path}: fTetWild: {found.n_cells} tetrahedra in {time.time() - began:.1f} s, volume {found.volume:.3f}")


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--program", default="target/release/brickfield")
    arguments.add_argument("stores", nargs="*", type=pathlib.Path)
    arguments.add_argument("--triangles", nargs="*", type=int, default=[10_000, 100_000, 1_000_000])
    arguments.add_argument("--peers", nargs="*", metavar="NAME")
    arguments.add_argument("--cgal", help="the compiled cgal_simplify.cpp, with --peers")
    arguments.add_argument("--tetrahedra", type=pathlib.Path)
    arguments.add_argument("--others", action="store_true")
    chosen = arguments.parse_args()
    if chosen.tetrahedra:
        return (tetrahedra_of_others if chosen.others else tetrahedra)(chosen.tetrahedra)
    are_right = True
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        asked = [fast_simplification, meshoptimizer, pymeshlab, meshlib]
        asked += [cgal(chosen.cgal, cost) for cost in ("lindstrom-turk", "garland-heckbert") if chosen.cgal]
        asked = [peer for peer in asked if not chosen.peers or peer.__name__.split(",")[0] in chosen.peers]
        if chosen.peers is not None:
            print("| store | asked | peer | triangles | volume off, % | surface | crossing pairs | store to mesh: rms, 99.8 %, mm | mesh to store | s |\n|---|---|---|---|---|---|---|---|---|---|")
        else:
            print(
                "| store | asked | triangles | cell, mm | tolerance, mm | volume off, % | mesh to store at 99.9%, mm (cells) "
                "| store to mesh, mean, mm | averaged away, % | surface | s |\n|---|---|---|---|---|---|---|---|---|---|---|"
            )
        for store in chosen.stores:
            fine = None
            if chosen.peers is not None:
                run(chosen.program, "mesh", store, "-o", folder / "fine.ply")
                fine = read_ply(folder / "fine.ply")
            for most in chosen.triangles:
                if chosen.peers is not None:
                    peers(chosen.program, store, most, fine, folder, asked)
                else:
                    are_right &= ours(chosen.program, store, most, folder)
    return 0 if are_right else 1


if __name__ == "__main__":
    sys.exit(main())
