#!/usr/bin/env python3
"""Builds the wheel and tests it as a user gets it.

    python tools/python/tests/run.py [--keep FOLDER | --wheel WHEEL] [--engines]

Makes a virtual environment, builds the wheel with maturin, installs it, runs the tests and the examples of the
documentation, and checks a user's script with `mypy --strict`. With --engines it hands meshes and columns to trimesh, pyvista
and pandas, too, and builds in shards on Dask and Ray, killing a worker of each. Prints the wheel's size and the seconds of each step.
"""

import argparse
import subprocess
import sys
import tempfile
import time
from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[1]
PINNED = ["maturin==1.16.0", "numpy==2.4.6", "mypy==1.18.2"]
ENGINES = ["dask==2026.8.0", "distributed==2026.8.0", "ray==2.60.0"]
OTHERS = ["trimesh==5.2.0", "pyvista==0.49.1", "pandas==3.1.1"]
WHEEL_BYTES_MAX = 15_000_000

USER = '''
import numpy as np

import brickfield


def solid_share(path: str) -> float:
    part = brickfield.build(path, depth=3)
    samples: np.ndarray = np.asarray(part.level(2))
    vertices, triangles = part.mesh(tolerance=0.1)
    _, _, normals = part.mesh(normals=True)
    print(len(vertices), len(triangles), normals.shape, part.volumes()["union"], part.slice(z=1.0).shape)
    return float((samples > 0).mean())
'''


def step(name: str, *command: object, **more: object) -> str:
    begun = time.time()
    done = subprocess.run([str(c) for c in command], capture_output=True, text=True, **more)
    print(f"{name}: {time.time() - begun:.0f} s")
    if done.returncode != 0:
        sys.exit(done.stdout + done.stderr)
    return done.stdout + done.stderr


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--keep", type=Path, help="a folder for the wheel")
    parser.add_argument("--wheel", type=Path, help="a wheel to test in the place of a new one")
    parser.add_argument("--engines", action="store_true", help="also build in shards on Dask and Ray")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        python = folder / "env" / "bin" / "python"
        step("environment", sys.executable, "-m", "venv", folder / "env")
        step("packages", python, "-m", "pip", "install", "--quiet", *PINNED)
        wheel = args.wheel
        if wheel is None:
            wheels = args.keep or folder / "wheels"
            step("wheel", python, "-m", "maturin", "build", "--release", "--out", wheels, cwd=PACKAGE)
            wheel = max(wheels.glob("*.whl"), key=lambda path: path.stat().st_mtime)
        print(f"{wheel.name}: {wheel.stat().st_size:,} bytes")
        if wheel.stat().st_size > WHEEL_BYTES_MAX:
            sys.exit("the wheel is too large")
        step("install", python, "-m", "pip", "install", "--quiet", wheel)
        if args.engines:
            step("other packages", python, "-m", "pip", "install", "--quiet", *OTHERS)
        print(step("tests", python, PACKAGE / "tests" / "test_package.py", cwd=folder).splitlines()[-3])
        script = folder / "user.py"
        script.write_text(USER)
        if args.engines:
            step("engines", python, "-m", "pip", "install", "--quiet", *ENGINES)
            clover = PACKAGE.parents[1] / "bench-data" / "clover.gcode"
            shards = PACKAGE / "tests" / "engines.py"
            print(step("shards", python, shards, clover, "--depth", "5", "--shards", "4", "--kill", cwd=folder).strip())
        print(step("types", python, "-m", "mypy", "--strict", script, cwd=folder).strip())


if __name__ == "__main__":
    main()
