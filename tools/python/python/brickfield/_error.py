"""The package's exception."""

from __future__ import annotations


class Error(Exception):
    """What went wrong, in which file and where, and what to do, in one line.

    ``kind`` is one of io, input, store, setting, device, interrupted, program. ``path`` is the file, if there is one.
    """

    # People know it by this name, in tracebacks, too.
    __module__ = "brickfield"

    def __init__(self, what: str, kind: str = "setting", path: str | None = None) -> None:
        super().__init__(what)
        self.kind = kind
        self.path = path
