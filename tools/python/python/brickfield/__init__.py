"""Exact winding numbers of toolpaths, triangle soups and point clouds in an octree of bricks.

>>> import numpy as np
>>> import brickfield
>>> vertices = np.array([[0, 0, 0], [10, 0, 0], [0, 10, 0], [0, 0, 10]], dtype=float)
>>> triangles = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
>>> part = brickfield.build((vertices, triangles), depth=2)
>>> part.sample(np.array([[1.0, 1.0, 1.0], [9.0, 9.0, 9.0]]))
array([1., 0.], dtype=float32)
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Sequence, Union, overload

import numpy as np

from . import _brickfield
from ._error import Error
from ._program import PathLike, Progress, columns, mesh_of, options_of, run

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Vertices = NDArray[np.float32]
    Triangles = NDArray[np.uint32]
    Columns = dict[str, NDArray[Any]]

__all__ = ["Error", "Level", "Octree", "Winding", "build", "open", "run", "winding"]

__version__: str = _brickfield.__version__


def _floats(array: Any) -> NDArray[np.float64]:
    return np.ascontiguousarray(array, dtype=np.float64)


class Level:
    """Samples of a level, indexed [z, y, x]; what is asked for is read."""

    def __init__(self, octree: Octree, level: int) -> None:
        if not 0 <= level <= octree.depth:
            raise Error(f"there is no level {level}; choose one from 0 to {octree.depth}")
        self._octree, self.level = octree, level
        axis = 32 << level
        #: Samples along z, y and x.
        self.shape: tuple[int, int, int] = (axis, axis, axis)
        #: World coordinates x, y, z of the sample [0, 0, 0].
        self.origin: tuple[float, float, float] = tuple(octree._octree.origin)
        #: World distance of two samples.
        self.spacing: float = octree._octree.spacing(level)
        self.dtype = np.dtype(np.float32)
        self.ndim = 3

    def __len__(self) -> int:
        return self.shape[0]

    def __getitem__(self, index: Any) -> Any:
        index = index if isinstance(index, tuple) else (index,)
        if Ellipsis in index:
            at = index.index(Ellipsis)
            index = index[:at] + (slice(None),) * (4 - len(index)) + index[at + 1 :]
        if len(index) > 3:
            raise IndexError(f"{len(index)} indices for 3 axes")
        index = index + (slice(None),) * (3 - len(index))
        first, last, then = [], [], []
        for i, n in zip(index, self.shape):
            if isinstance(i, slice):
                start, stop, step = i.indices(n)
                if step < 1:
                    raise IndexError("steps go upwards")
                first.append(start)
                last.append(max(stop, start))
                then.append(slice(None, None, step))
            else:
                i = int(i)
                if not -n <= i < n:
                    raise IndexError(f"index {i} of {n} samples")
                first.append(i % n)
                last.append(i % n + 1)
                then.append(0)
        samples = self._octree._octree.read(self.level, first[::-1], last[::-1])
        return samples[tuple(then)]

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        array = self[:, :, :]
        return array if dtype is None else array.astype(dtype)


class Octree:
    """An octree of winding numbers, in a store or in memory; made by `build` and `open`."""

    def __init__(self, octree: Any) -> None:
        self._octree = octree

    @property
    def path(self) -> Path | None:
        """The store; None in memory."""
        path = self._octree.path
        return None if path is None else Path(path)

    @property
    def bounds(self) -> NDArray[np.float64]:
        """Least and greatest coordinates of the inputs, shape (2, 3)."""
        return np.array(self._octree.bounds)

    @property
    def unit(self) -> str:
        """The unit of length, as in mm."""
        return str(self._octree.unit)

    @property
    def depth(self) -> int:
        """The deepest level."""
        return int(self._octree.depth)

    @property
    def range(self) -> tuple[int, int]:
        """Smallest and largest w."""
        return tuple(self._octree.range)

    @property
    def bricks_read(self) -> int | None:
        """How many bricks were read from the store so far; None in memory."""
        return self._octree.bricks_read

    def sample(self, points: Any) -> NDArray[np.float32]:
        """w at points of shape (n, 3), between samples trilinear; 0 outside of the root cube."""
        return self._octree.sample(_floats(points))

    def level(self, level: int) -> Level:
        """Samples of a level, lazily.

        >>> part = build((VERTICES, TRIANGLES), depth=2)
        >>> part.level(2).shape
        (128, 128, 128)
        >>> float(part.level(1)[5, 5, 5])
        1.0
        """
        return Level(self, level)

    @overload
    def mesh(
        self, iso: float = ..., tolerance: float = ..., level: int | None = ..., *, progress: Progress | None = ...
    ) -> tuple[Vertices, Triangles]: ...
    @overload
    def mesh(
        self, iso: float = ..., tolerance: float = ..., level: int | None = ..., *, normals: Literal[True],
        progress: Progress | None = ...,
    ) -> tuple[Vertices, Triangles, Vertices]: ...
    @overload
    def mesh(
        self, iso: float = ..., tolerance: float = ..., level: int | None = ..., *, attributes: Sequence[str],
        progress: Progress | None = ...,
    ) -> tuple[Vertices, Triangles, Columns]: ...
    def mesh(
        self,
        iso: float = 0.5,
        tolerance: float = 0.0,
        level: int | None = None,
        *,
        normals: bool = False,
        attributes: Sequence[str] | None = None,
        progress: Progress | None = None,
    ) -> Any:
        """The surface w = iso as vertices (n, 3) and triangles (m, 3): closed, manifold, without self-intersections.

        With `normals` also the outward unit normals of the vertices (n, 3). With `attributes` also columns with a row a
        triangle, any of bead, layer and feature, from a store that was built with `identity`.

        >>> vertices, triangles, normals = build((VERTICES, TRIANGLES), depth=2).mesh(normals=True)
        >>> vertices.shape == normals.shape, triangles.dtype
        (True, dtype('uint32'))
        """
        if attributes is None:
            return self._octree.mesh(iso, tolerance, level, normals, progress)
        if normals:
            raise Error("a mesh has normals or attributes; ask for one of them")
        options = options_of({"iso": iso, "tolerance": tolerance, "level": level})
        command: list[PathLike] = ["mesh", self._store(), *options, "--attributes", ",".join(attributes)]
        vertices, faces, lines = mesh_of(*command, progress=progress)
        found = {name: faces[name].copy() for name in attributes}
        if "feature" in found:
            names = [line.split(maxsplit=3)[3:] for line in lines if line.startswith("comment feature ")]
            # The last one is none, which is -1.
            found["feature"] = np.array([name[0] if name else "" for name in names] + [""])[found["feature"]]
        points = np.stack([vertices[axis] for axis in "xyz"], axis=1)
        return points, faces["corners"].copy(), found

    def volumes(self) -> dict[str, float]:
        """Volumes of union and overlap, each with a bound on its error.

        >>> found = build((VERTICES, TRIANGLES), depth=2).volumes()
        >>> abs(found["union"] - 1000 / 6) <= found["union_error"]
        True
        """
        return dict(self._octree.volumes())

    def slice(self, *, x: float | None = None, y: float | None = None, z: float | None = None) -> NDArray[np.uint8]:
        """A section as pixels (h, w, 3)."""
        given = [(axis, at) for axis, at in (("x", x), ("y", y), ("z", z)) if at is not None]
        if len(given) != 1:
            raise Error("a section has one of x, y and z")
        return self._octree.slice(*given[0])

    def render(self, view: str = "iso") -> NDArray[np.uint8]:
        """The part as pixels (h, w, 3), seen from iso, top, bottom, front, back, left or right."""
        return self._octree.render(view)

    def write_mesh(self, path: PathLike) -> None:
        """Writes the mesh of the union as .stl, .ply, .obj, .glb or .3mf."""
        self._octree.write_mesh(os.fspath(path))

    def export(self, path: PathLike, *options: str) -> dict[str, Any]:
        """Writes levels as a volume, by the ending of the name; options as `brickfield export` takes them."""
        return run("export", self._store(), "-o", path, *options)

    def voids(self, *options: str) -> dict[str, NDArray[Any]]:
        """Voids that the part encloses, a row each, as columns; options as `brickfield voids` takes them."""
        return columns("voids", self._store(), *options)

    def layers(self, *options: str) -> dict[str, NDArray[Any]]:
        """Areas, volumes and voids by layer, as columns; options as `brickfield layers` takes them."""
        return columns("layers", self._store(), *options)

    def overlap(self, *options: str) -> dict[str, NDArray[Any]]:
        """Pairs of beads that overlap, as columns; options as `brickfield overlap` takes them."""
        return columns("overlap", self._store(), *options)

    def thickness(self, *options: str) -> dict[str, NDArray[np.float32]]:
        """Wall thickness at the vertices of the mesh, or the width of gaps: columns x, y, z, thickness.

        Options as `brickfield thickness` takes them. Infinite where nothing is opposite.
        """
        return self._at_vertices("thickness", *options)

    def deviation(self, reference: PathLike, *options: str) -> dict[str, NDArray[np.float32]]:
        """Signed distances of the mesh's vertices from a mesh or store, outside positive: columns x, y, z, deviation.

        Options as `brickfield deviation` takes them.
        """
        return self._at_vertices("deviation", os.fspath(reference), *options)

    def csg(self, out: PathLike, *options: str) -> Octree:
        """Joins, takes off and intersects, in order, to a new store; options as `brickfield csg` takes them.

        As in `part.csg("cut.brf", "--minus", "cylinder 31,31,r5mm,z", "--and", "z<20mm")`.
        """
        run("csg", self._store(), "-o", out, *options)
        return open(out)

    def machine(self, program: PathLike, out: PathLike, *options: str) -> tuple[Octree, Columns]:
        """Takes off what the tools of a milling program sweep: the new store, and what becomes of each void as columns.

        Options as `brickfield machine` takes them, as in `part.machine("face.nc", "cut.brf", "--tool", "ball:6mm")`.
        """
        opened = columns("machine", self._store(), program, "-o", out, *options, table="--voids")
        return open(out), opened

    def offset(self, out: PathLike, *options: str) -> Octree:
        """Grows, shrinks or hollows, to a new store; options as `brickfield offset` takes them."""
        run("offset", self._store(), "-o", out, *options)
        return open(out)

    def to_trimesh(self, **options: Any) -> Any:
        """The mesh as a trimesh.Trimesh; needs trimesh."""
        import trimesh

        vertices, triangles = self.mesh(**options)
        return trimesh.Trimesh(vertices, triangles, process=False)

    def to_pyvista(self, **options: Any) -> Any:
        """The mesh as a pyvista.PolyData; needs pyvista."""
        import pyvista

        vertices, triangles = self.mesh(**options)
        faces = np.hstack([np.full((len(triangles), 1), 3, dtype=np.int64), triangles.astype(np.int64)])
        return pyvista.PolyData(vertices, faces.ravel())

    def _store(self) -> Path:
        path = self.path
        if path is None:
            raise Error("this octree is in memory; build it with out= to a file")
        return path

    def _at_vertices(self, command: str, *arguments: str) -> Columns:
        vertices, _, _ = mesh_of(command, self._store(), *arguments)
        return {name: vertices[name].copy() for name in vertices.dtype.names or ()}


def open(path: PathLike) -> Octree:
    """Opens a store.

    >>> import tempfile, pathlib
    >>> store = pathlib.Path(tempfile.mkdtemp()) / "part.brf"
    >>> _ = build((VERTICES, TRIANGLES), store, depth=1)
    >>> open(store).depth
    1
    """
    return Octree(_brickfield.open(os.fspath(path)))


def build(
    inputs: Any,
    out: PathLike | None = None,
    *,
    depth: int | None = None,
    max_depth: int | None = None,
    cell: float | str | None = None,
    boundary_error: float | str | None = None,
    stddev: float | None = None,
    gwn_error: float | None = None,
    memory: int | str | None = None,
    threads: int | None = None,
    identity: bool = False,
    restart: bool = False,
    unit: str | None = None,
    progress: Progress | None = None,
    **options: Any,
) -> Octree:
    """Builds an octree of a path, a list of paths, `(vertices, triangles)` or `(points, normals)`, to a store or in memory.

    Settings are the options of `brickfield build`, with underscores. `depth` is the deepest level, or `cell` the edge of its
    cells. `memory` bounds the work, as in "2GiB". `identity` records which beads a sample counts. Options that are not listed
    here, as `skip="auto"`, and lengths with units, as `cell="0.1mm"`, are for files that are built to a store: the program
    builds it in a process of its own.

    `progress(phase, done, total)` is called some times a second; what it raises stops the work, as Ctrl-C does.

    >>> build((VERTICES, TRIANGLES), depth=1).range
    (0, 1)
    """
    items = inputs if isinstance(inputs, list) else [inputs]
    settings: dict[str, Any] = {
        "depth": depth, "max_depth": max_depth, "cell": cell, "boundary_error": boundary_error, "stddev": stddev,
        "gwn_error": gwn_error, "memory": memory, "threads": threads, "identity": identity, "restart": restart, "unit": unit,
    }
    if options or isinstance(cell, str) or isinstance(boundary_error, str):
        asked = [*options, *(name for name in ("cell", "boundary_error") if isinstance(settings[name], str))]
        if out is None or any(not isinstance(item, (str, os.PathLike)) for item in items):
            raise Error(f"{', '.join(asked)}: for files that are built to a store; give paths and out, and lengths as numbers")
        run("build", *items, "-o", out, *options_of({**settings, **options}), progress=progress)
        return open(out)

    def one(item: Any) -> Any:
        if isinstance(item, (str, os.PathLike)):
            return os.fspath(item)
        first, second = item
        second = np.asarray(second)
        return (_floats(first), _floats(second) if second.dtype.kind == "f" else second)

    path = None if out is None else os.fspath(out)
    return Octree(_brickfield.build([one(item) for item in items], path, {**settings, "memory": _bytes(memory)}, progress))


def _bytes(size: int | str | None) -> int | None:
    if size is None or isinstance(size, int):
        return size
    for ending, factor in (("KiB", 1 << 10), ("MiB", 1 << 20), ("GiB", 1 << 30), ("B", 1)):
        if size.endswith(ending):
            return int(float(size.removesuffix(ending)) * factor)
    raise Error(f"{size!r} is no size; write it as in 512MiB or 2GiB")


class Winding:
    """The winding number of triangles, to be asked at any points: exact where they close, otherwise within 1e-6.

    >>> w = Winding(VERTICES, TRIANGLES)
    >>> w([[1.0, 1.0, 1.0]])
    array([1.])
    """

    def __init__(self, vertices: Any, triangles: Any) -> None:
        self._winding = _brickfield.Winding(_floats(vertices), np.asarray(triangles))

    def __call__(self, points: Any) -> NDArray[np.float64]:
        return self._winding(_floats(points))


def winding(vertices: Any, triangles: Any, points: Any) -> NDArray[np.float64]:
    """The winding number of triangles at points; see `Winding` for many calls.

    >>> winding(VERTICES, TRIANGLES, [[1.0, 1.0, 1.0], [20.0, 0.0, 0.0]])
    array([1., 0.])
    """
    return Winding(vertices, triangles)(points)
