"""The program in a process of its own: its options, progress, tables and meshes."""

from __future__ import annotations

import csv
import json
import os
import signal
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any, Callable, Mapping, Sequence, Union

import numpy as np

from ._error import Error

if TYPE_CHECKING:
    from numpy.typing import NDArray

PathLike = Union[str, "os.PathLike[str]"]
Progress = Callable[[str, int, Union[int, None]], None]

#: The command that runs the program.
PROGRAM = [sys.executable, str(Path(__file__).with_name("__main__.py"))]

#: Types of numbers in PLY files.
_PLY_TYPES = {"float": "<f4", "double": "<f8", "int": "<i4", "uint": "<u4", "uchar": "u1"}


def run(*arguments: str | PathLike, progress: Progress | None = None) -> dict[str, Any]:
    """Runs a command of the program and returns what it prints as JSON.

    `progress(phase, done, total)` is called once a second; what it raises stops the program, as Ctrl-C does.

    >>> run("info", "missing.brf")  # doctest: +ELLIPSIS
    Traceback (most recent call last):
    ...
    brickfield.Error: missing.brf: cannot open: ...
    """
    command = [*PROGRAM, *(os.fspath(argument) for argument in arguments), "--json"]
    if progress is not None:
        command += ["--progress", "json"]
    lines = []
    with tempfile.TemporaryFile("w+") as printed:
        with subprocess.Popen(command, stdout=printed, stderr=subprocess.PIPE, text=True) as process:
            assert process.stderr is not None
            try:
                for line in process.stderr:
                    if progress is not None and line.startswith("{"):
                        told = json.loads(line)
                        progress(told["phase"], told["done"], told["total"])
                    elif not line.startswith(("brickfield: warning", "brickfield: note")):
                        lines.append(line.rstrip())
            except BaseException:
                # It makes safe what it has, and ends.
                process.send_signal(signal.SIGINT)
                raise
        if process.returncode != 0:
            what = lines[0].removeprefix("brickfield: ") if lines else f"the program ended with {process.returncode}"
            raise Error(what, "program")
        printed.seek(0)
        return dict(json.load(printed))


def options_of(settings: Mapping[str, Any]) -> list[str]:
    """Settings as the program's options: ``depth=4``, ``identity=True``, ``boundary_error="0.1mm"``, ``skip=["Skirt"]``."""
    options: list[str] = []
    for name, value in settings.items():
        option = "--" + name.replace("_", "-")
        if value is True:
            options.append(option)
        elif isinstance(value, (list, tuple)):
            for one in value:
                options += [option, str(one)]
        elif value is not None and value is not False:
            options += [option, str(value)]
    return options


def columns(command: str, *arguments: str | PathLike, table: str = "-o") -> dict[str, NDArray[Any]]:
    """The table that a command writes with the option `table`, as columns."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "table.csv"
        told = run(command, *arguments, table, path)
        # Names stand there also where there are no rows; JSON has the types.
        with path.open(newline="") as file:
            names = next(csv.reader(file))
    tables = [value for value in told.values() if isinstance(value, list) and value and isinstance(value[0], dict)]
    rows = next((rows for rows in tables if set(names) <= set(rows[0])), [])
    return {name: _column([row[name] for row in rows]) for name in names}


def _column(values: list[Any]) -> NDArray[Any]:
    """Values as an array; of numbers unknown ones are no numbers, of texts empty."""
    kinds = {type(value) for value in values if value is not None}
    if kinds <= {int, float}:
        return np.array([np.nan if value is None else value for value in values], dtype=None if values else float)
    if kinds == {str}:
        return np.array(["" if value is None else value for value in values])
    column = np.empty(len(values), dtype=object)
    column[:] = values
    return column


def mesh_of(*command: str | PathLike, progress: Progress | None = None) -> tuple[NDArray[Any], NDArray[Any], list[str]]:
    """The mesh that a command writes: vertices and faces as arrays with fields, and the lines of its header."""
    with tempfile.TemporaryDirectory() as folder:
        mesh = Path(folder) / "mesh.ply"
        run(*command, "-o", mesh, progress=progress)
        head, rows = mesh.read_bytes().split(b"end_header\n", 1)
    lines = head.decode().splitlines()
    tables, at = [], 0
    for kind, count, fields in _elements(lines):
        table = np.frombuffer(rows, np.dtype(fields), count, at)
        at += table.nbytes
        tables.append(table)
    return tables[0], tables[1], lines


def _elements(lines: Sequence[str]) -> list[tuple[str, int, list[Any]]]:
    """Elements of a PLY file with their fields. Lists are corners, three a face, behind their number."""
    elements: list[tuple[str, int, list[Any]]] = []
    for words in (line.split() for line in lines):
        if words[0] == "element":
            elements.append((words[1], int(words[2]), []))
        elif words[:2] == ["property", "list"]:
            elements[-1][2].extend([("count", _PLY_TYPES[words[2]]), ("corners", _PLY_TYPES[words[3]], 3)])
        elif words[0] == "property":
            elements[-1][2].append((words[2], _PLY_TYPES[words[1]]))
    return elements
