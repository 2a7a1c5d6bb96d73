from typing import Any

__version__: str

def main(arguments: list[str]) -> int: ...
def open(path: str) -> Any: ...
def build(
    inputs: list[Any],
    out: str | None,
    depth: int | None,
    cell: float | None,
    memory: int | None,
    identity: bool,
    unit: str | None,
    sample_error: float | None,
    progress: Any,
) -> Any: ...

class Winding:
    def __init__(self, vertices: Any, triangles: Any) -> None: ...
    def __call__(self, points: Any) -> Any: ...
