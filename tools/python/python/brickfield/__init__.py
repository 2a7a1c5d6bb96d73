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
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any, Callable, Union

import json
import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Error", "Level", "Octree", "Winding", "build", "open", "run", "winding"]

PathLike = Union[str, "os.PathLike[str]"]
Progress = Callable[[str, int, Union[int, None]], None]


class Error(Exception):
    """What went wrong, in which file and where, and what to do, in one line.

    ``kind`` is one of io, input, store, setting, device, interrupted, program. ``path`` is the file, if there is one.
    """

    def __init__(self, what: str, kind: str = "setting", path: str | None = None) -> None:
        super().__init__(what)
        self.kind = kind
        self.path = path


# The extension looks for the class above.
from . import _brickfield  # noqa: E402

__version__: str = _brickfield.__version__


def _floats(array: Any) -> NDArray[np.float64]:
    return np.ascontiguousarray(array, dtype=np.float64)


def run(*arguments: str | PathLike) -> dict[str, Any]:
    """Runs a command of the program and returns what it prints as JSON.

    >>> run("info", "missing.brf")  # doctest: +ELLIPSIS
    Traceback (most recent call last):
    ...
    brickfield.Error: missing.brf: cannot open: ...
    """
    command = [sys.executable, "-m", "brickfield", *map(os.fspath, arguments), "--json"]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode != 0:
        lines = [line for line in done.stderr.splitlines() if not line.startswith(("brickfield: warning", "brickfield: note"))]
        what = lines[0].removeprefix("brickfield: ") if lines else f"the program ended with {done.returncode}"
        raise Error(what, "program")
    return dict(json.loads(done.stdout))


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

    def mesh(
        self,
        iso: float = 0.5,
        tolerance: float = 0.0,
        level: int | None = None,
        progress: Progress | None = None,
    ) -> tuple[NDArray[np.float32], NDArray[np.uint32]]:
        """The surface w = iso as vertices (n, 3) and triangles (m, 3): closed, manifold, without self-intersections.

        >>> vertices, triangles = build((VERTICES, TRIANGLES), depth=2).mesh()
        >>> vertices.shape[1], triangles.dtype
        (3, dtype('uint32'))
        """
        return self._octree.mesh(iso, tolerance, level, progress)

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
        """Voids that the part encloses, a column each; options as `brickfield voids` takes them."""
        return self._table("voids", *options)

    def layers(self, *options: str) -> dict[str, NDArray[Any]]:
        """Areas, volumes and voids by layer, a column each; options as `brickfield layers` takes them."""
        return self._table("layers", *options)

    def overlap(self, *options: str) -> dict[str, NDArray[Any]]:
        """Pairs of beads that overlap, a column each; options as `brickfield overlap` takes them."""
        return self._table("overlap", *options)

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

    def _table(self, command: str, *options: str) -> dict[str, NDArray[Any]]:
        with tempfile.TemporaryDirectory() as folder:
            table = Path(folder) / "table.json"
            run(command, self._store(), "-o", table, *options)
            told = json.loads(table.read_text())
        rows = next(value for value in told.values() if isinstance(value, list) and all(isinstance(r, dict) for r in value))
        names = list(dict.fromkeys(name for row in rows for name in row))
        return {name: np.array([row.get(name) for row in rows]) for name in names}

    def _at_vertices(self, command: str, *arguments: str) -> dict[str, NDArray[np.float32]]:
        with tempfile.TemporaryDirectory() as folder:
            mesh = Path(folder) / "mesh.ply"
            run(command, self._store(), *arguments, "-o", mesh)
            head, rows = mesh.read_bytes().split(b"end_header\n", 1)
        words = [line.split() for line in head.decode().splitlines()]
        count = next(int(line[2]) for line in words if line[:2] == ["element", "vertex"])
        names = [line[2] for line in words if line[:2] == ["property", "float"]]
        table = np.frombuffer(rows, "<f4", count * len(names)).reshape(count, len(names))
        return {name: table[:, n].copy() for n, name in enumerate(names)}


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
    cell: float | None = None,
    memory: int | str | None = None,
    identity: bool = False,
    unit: str | None = None,
    sample_error: float | None = None,
    progress: Progress | None = None,
) -> Octree:
    """Builds an octree of a path, a list of paths, `(vertices, triangles)` or `(points, normals)`, to a store or in memory.

    `depth` is the deepest level, or `cell` the edge of its cells. `memory` bounds the work, as in "2GiB". `identity` records
    which beads a sample counts. `progress(phase, done, total)` is called some times a second; what it raises stops the work,
    as Ctrl-C does.

    >>> build((VERTICES, TRIANGLES), depth=1).range
    (0, 1)
    """
    all = inputs if isinstance(inputs, list) else [inputs]

    def one(item: Any) -> Any:
        if isinstance(item, (str, os.PathLike)):
            return os.fspath(item)
        first, second = item
        second = np.asarray(second)
        return (_floats(first), _floats(second) if second.dtype.kind == "f" else second)

    path = None if out is None else os.fspath(out)
    made = _brickfield.build(
        [one(item) for item in all], path, depth, cell, _bytes(memory), identity, unit, sample_error, progress
    )
    return Octree(made)


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
