"""libigl's fast winding numbers of a soup at the samples of a dense grid: samples per second and errors.

    pip install libigl numpy
    make-input pile --triangles 1000000 -o pile.stl
    python fast_winding_number.py pile.stl --lose 0.03 --keep lost.stl
    brickfield build lost.stl -o lost.brf --depth 2 --gwn-error 0.4 --threads 2 --json
    brickfield export lost.brf --level 2 --dtype f4 -o lost.npy
    python fast_winding_number.py lost.stl --array lost.npy

The first writes what is left of the pile when 3 % of its facets are deleted at random, and asks libigl for
the samples of level 2, 128^3 of them, which the build evaluates in the same places; the last judges these.
"""

import argparse
import time

import igl
import numpy as np


def read_stl(path):
    """Facets of a binary STL, and its bytes as records."""
    record = np.dtype([("normal", "<f4", 3), ("facet", "<f4", (3, 3)), ("attribute", "<u2")])
    with open(path, "rb") as file:
        file.seek(80)
        count = int(np.frombuffer(file.read(4), "<u4")[0])
        return np.fromfile(file, record, count)


def write_stl(path, records):
    with open(path, "wb") as file:
        file.write(b"facets of a pile".ljust(80))
        file.write(np.uint32(len(records)).tobytes())
        records.tofile(file)


def samples_of(facets, samples):
    """The samples of a level with so many an axis, in the root cube as the engine places it."""
    low, high = facets.min(axis=(0, 1)), facets.max(axis=(0, 1))
    edge = (high - low).max() * ROOT_MARGIN
    origin = 0.5 * (low + high) - 0.5 * edge
    at = np.arange(samples) / samples * edge + edge / 2**24
    z, y, x = np.meshgrid(origin[2] + at, origin[1] + at, origin[0] + at, indexing="ij")
    return np.column_stack([x.ravel(), y.ravel(), z.ravel()])


# As in `RootCube::around`.
ROOT_MARGIN = 32 / 31


def exact(facets, points):
    """The sum of solid angles over 4 pi, in double precision (Van Oosterom and Strackee 1983)."""
    found = np.zeros(len(points))
    for number, point in enumerate(points):
        a, b, c = (facets[:, i] - point for i in range(3))
        la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
        num = np.einsum("ij,ij->i", a, np.cross(b, c))
        dots = [np.einsum("ij,ij->i", u, v) for u, v in ((a, b), (b, c), (c, a))]
        den = la * lb * lc + dots[0] * lc + dots[1] * la + dots[2] * lb
        found[number] = np.arctan2(num, den).sum() / (2 * np.pi)
    return found


def libigl(facets, points):
    """Samples, and how long they took, the hierarchy apart."""
    vertices, corners = np.unique(facets.reshape(-1, 3), axis=0, return_inverse=True)
    corners = corners.reshape(-1, 3).astype(np.int64)

    def seconds(query):
        start, processor = time.perf_counter(), time.process_time()
        w = igl.fast_winding_number(vertices, corners, query)
        return w, time.perf_counter() - start, time.process_time() - processor

    _, *first = seconds(points[:1])
    w, *both = seconds(points)
    wall, processor = both[0] - first[0], both[1] - first[1]
    print(f"{len(facets)} facets, {len(points)} samples, hierarchy {first[0]:.2f} s")
    print(f"{wall:.2f} s, {processor:.2f} s of processor time: {len(points) / wall:.0f} samples/s")
    return w


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("soup")
    parser.add_argument("--lose", type=float, default=0.0, help="share of facets to delete")
    parser.add_argument("--keep", help="write what is left to this STL")
    parser.add_argument("--samples", type=int, default=128, help="samples an axis")
    parser.add_argument("--check", type=int, default=2000, help="samples compared with the exact sum")
    parser.add_argument("--array", help="judge the samples of this export, and leave libigl out")
    asked = parser.parse_args()
    records = read_stl(asked.soup)
    chance = np.random.Generator(np.random.PCG64(1))
    if asked.lose > 0:
        records = records[chance.random(len(records)) >= asked.lose]
    if asked.keep:
        write_stl(asked.keep, records)
    facets = records["facet"].astype(np.float64)
    points = samples_of(facets, asked.samples)
    if asked.array:
        n = asked.samples
        w = np.load(asked.array)[:n, :n, :n].reshape(-1).astype(np.float64)
    else:
        w = libigl(facets, points)
    # Half of the checked samples in the soup's own box, where the errors are.
    low, high = facets.min(axis=(0, 1)), facets.max(axis=(0, 1))
    inside = np.flatnonzero(((points >= low) & (points <= high)).all(axis=1))
    chosen = np.concatenate([chance.choice(len(points), asked.check // 2), chance.choice(inside, asked.check // 2)])
    # Those on the root's own faces count as outside in a store.
    chosen = chosen[(np.stack(np.unravel_index(chosen, (asked.samples,) * 3)) > 0).all(axis=0)]
    error = np.abs(w[chosen] - exact(facets, points[chosen]))
    print(f"error: rms {np.sqrt((error**2).mean()):.2e}, 99 % below {np.quantile(error, 0.99):.2e}, worst {error.max():.2e}")


if __name__ == "__main__":
    main()
