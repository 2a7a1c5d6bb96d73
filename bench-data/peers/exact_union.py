"""The exact union of a soup of closed pieces, its volume, and how many cavities it encloses.

    python exact_union.py SOUP.stl [--libigl] [--facets PIECE] [-o UNION.stl]

Manifold unites the pieces, parts of the soup that hang together, and takes away those that are inside out; with
`--facets` each so many facets are a piece. libigl's self-union by CGAL's exact numbers also resolves pieces that overlap
themselves. Prints JSON; seconds without reading and welding. A cavity is a shell of negative volume; `cavity_edges` are
the 1st, 10th and 50th percentiles of the cube roots of their volumes.
"""

import argparse
import json
from importlib.metadata import version

import igl
import numpy as np
from peers import read_soup, timed, volume_of, weld


def pieces_of(facets, size):
    if size:
        return [weld(facets[i : i + size]) for i in range(0, len(facets), size)]
    vertices, corners = weld(facets)
    label = igl.facet_components(corners)
    label = label[1] if isinstance(label, tuple) else label
    return [weld(facets[label == n]) for n in range(label.max() + 1)]


def by_manifold(facets, size):
    import manifold3d

    pieces = pieces_of(facets, size)

    def unite():
        groups = {True: [], False: []}
        for vertices, corners in pieces:
            outward = volume_of(vertices[corners]) > 0
            corners = corners if outward else corners[:, ::-1]
            mesh = manifold3d.Mesh(vertices.astype(np.float32), np.ascontiguousarray(corners, np.uint32))
            groups[outward].append(manifold3d.Manifold(mesh))
        union = manifold3d.Manifold.batch_boolean(groups[True], manifold3d.OpType.Add)
        if groups[False]:
            union -= manifold3d.Manifold.batch_boolean(groups[False], manifold3d.OpType.Add)
        return union, union.num_tri()  # evaluated only when asked for

    seconds, (union, _) = timed(unite)
    mesh = union.to_mesh64()
    return seconds, np.asarray(mesh.vert_properties)[:, :3], np.asarray(mesh.tri_verts).astype(np.int64)


def by_libigl(facets):
    from igl.copyleft import cgal

    vertices, corners = weld(facets)
    nothing = np.zeros((0, 3)), np.zeros((0, 3), corners.dtype)
    seconds, told = timed(lambda: cgal.mesh_boolean(vertices, corners, *nothing, "union"))
    return seconds, told[0], told[1].astype(np.int64)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("soup")
    parser.add_argument("--libigl", action="store_true")
    parser.add_argument("--facets", type=int)
    parser.add_argument("-o", dest="output")
    asked = parser.parse_args()
    facets = read_soup(asked.soup)
    if asked.libigl:
        who, (seconds, vertices, corners) = "libigl", by_libigl(facets)
    else:
        who, (seconds, vertices, corners) = "manifold3d", by_manifold(facets, asked.facets)
    told = {"who": f"{who} {version(who)}", "seconds": seconds, "triangles": len(corners)}
    label = igl.facet_components(corners)
    label = label[1] if isinstance(label, tuple) else label
    a, b, c = (vertices[corners[:, k]] for k in range(3))
    volumes = np.bincount(label, np.einsum("ij,ij->i", a, np.cross(b, c)) / 6)
    edges = np.cbrt(-volumes[volumes < 0])
    told |= {"volume": volumes.sum(), "shells": len(volumes), "cavities": len(edges)}
    if len(edges):
        told["cavity_edges"] = np.percentile(edges, [1, 10, 50]).tolist()
    if asked.output:
        record = np.zeros(len(corners), [("normal", "<f4", 3), ("facet", "<f4", (3, 3)), ("attribute", "<u2")])
        record["facet"] = vertices[corners]
        with open(asked.output, "wb") as file:
            file.write(b" " * 80 + np.uint32(len(corners)).tobytes() + record.tobytes())
    print(json.dumps(told))


if __name__ == "__main__":
    main()
