#!/usr/bin/env python3
"""Thickness, offset and deviation against closed forms, and beside other programs; needs numpy.

    python3 bench-data/distance.py --program target/release/brickfield FOLDER
    python3 bench-data/distance.py --program target/release/brickfield FOLDER --peers   # needs meshlib, trimesh, scipy
"""

import argparse
import os
import struct
import subprocess
import time

import numpy as np


def torus(large, small, around, across):
    """Vertices and triangles of a torus about z."""
    u, v = np.arange(around) * 2 * np.pi / around, np.arange(across) * 2 * np.pi / across
    u, v = np.meshgrid(u, v, indexing="ij")
    rho = large + small * np.cos(v)
    vertices = np.stack([rho * np.cos(u), rho * np.sin(u), small * np.sin(v)], -1).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(around), np.arange(across), indexing="ij")
    a, b = i * across + j, (i + 1) % around * across + j
    c, d = (i + 1) % around * across + (j + 1) % across, i * across + (j + 1) % across
    faces = [np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)]
    return vertices, np.concatenate(faces)


def write_stl(path, vertices, faces):
    record = np.zeros(len(faces), dtype=[("n", "<f4", 3), ("v", "<f4", (3, 3)), ("a", "<u2")])
    record["v"] = vertices[faces]
    with open(path, "wb") as file:
        file.write(b"\0" * 80 + struct.pack("<I", len(faces)) + record.tobytes())


def scalars(path):
    """Positions and numbers of a PLY that the program wrote."""
    with open(path, "rb") as file:
        data = file.read()
    start = data.index(b"end_header\n") + 11
    count = int(data[:start].decode().split("element vertex ")[1].split()[0])
    return np.frombuffer(data, "<f4", count * 4, start).reshape(-1, 4).astype(float)


def told(name, seconds, count, errors):
    shares = "p50 %.5f p99 %.5f max %.5f" % tuple(np.percentile(errors, [50, 99, 100]))
    print(f"{name}: {count / seconds:.0f} a second, relative errors {shares}", flush=True)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--program", default="target/release/brickfield")
    parser.add_argument("--peers", action="store_true")
    parser.add_argument("folder")
    args = parser.parse_args()
    path = lambda name: os.path.join(args.folder, name)
    run = lambda *words: subprocess.run([args.program, *words, "-q"], check=True)
    write_stl(path("torus.stl"), *torus(10, 3, 1200, 400))
    run("build", path("torus.stl"), "-o", path("torus.brf"), "--cell", "0.25")
    for method in ("sphere", "ray"):
        begin = time.time()
        run("thickness", path("torus.brf"), "-o", path("t.ply"), "--method", method)
        seconds = time.time() - begin
        values = scalars(path("t.ply"))[:, 3]
        told(f"thickness by {method}", seconds, len(values), np.abs(values - 6) / 6)
    for by in ("1", "-1"):
        begin = time.time()
        run("offset", path("torus.brf"), "--by", by, "-o", path("o.brf"))
        seconds = time.time() - begin
        run("mesh", path("o.brf"), "-o", path("o.ply"))
        run("deviation", path("o.brf"), path("torus.stl"), "-o", path("d.ply"))
        off = np.abs(scalars(path("d.ply"))[:, 3] - float(by)) / 0.25
        print(f"offset by {by}: {len(off) / seconds:.0f} vertices a second, mesh off by rms "
              f"{np.sqrt((off ** 2).mean()):.5f} cells, max {off.max():.5f}", flush=True)
    begin = time.time()
    run("deviation", path("torus.brf"), path("torus.stl"), "-o", path("d.ply"))
    print(f"deviation: {time.time() - begin:.2f} s for {len(scalars(path('d.ply')))} vertices and 980,000 points back")
    if args.peers:
        peers()


def peers():
    import meshlib.mrmeshnumpy as numpy_of
    import meshlib.mrmeshpy as meshlib
    import trimesh

    vertices, faces = torus(10, 3, 240, 80)
    mesh = numpy_of.meshFromFacesVerts(faces.astype(np.int32), vertices)
    numbers = lambda found: np.array([found.vec[n] for n in range(found.size())])
    begin = time.time()
    found = meshlib.computeRayThicknessAtVertices(mesh)
    told("MeshLib by ray", time.time() - begin, found.size(), np.abs(numbers(found) - 6) / 6)
    for cosine in (-1, 0):
        settings = meshlib.InSphereSearchSettings()
        settings.minAngleCos = cosine
        settings.maxRadius = 10
        begin = time.time()
        found = meshlib.computeInSphereThicknessAtVertices(mesh, settings)
        errors = np.abs(numbers(found) - 6) / 6
        told(f"MeshLib by sphere, minAngleCos {cosine}", time.time() - begin, found.size(), errors)
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    points, on = trimesh.sample.sample_surface(mesh, 400, seed=1)
    begin = time.time()
    normals = mesh.face_normals[on]
    found = trimesh.proximity.thickness(mesh, points, exterior=False, normals=normals, method="max_sphere")
    told("trimesh by sphere", time.time() - begin, 400, np.abs(found - 6) / 6)
    begin = time.time()
    trimesh.proximity.signed_distance(mesh, points + 0.1)
    print(f"trimesh, signed distances: {400 / (time.time() - begin):.0f} a second")


if __name__ == "__main__":
    main()
