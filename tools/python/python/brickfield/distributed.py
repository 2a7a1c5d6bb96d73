"""Builds on many machines: shards on the workers of Dask or Ray, or in the processes of this machine.

Each shard is one run of the program. All workers need this package and see the same folders. The store has the bytes of one
build. Shards that are finished stay in ``folder`` when another one fails; the same call builds only those that are missing.

>>> import tempfile, pathlib, numpy as np, brickfield
>>> from concurrent.futures import ThreadPoolExecutor
>>> folder = pathlib.Path(tempfile.mkdtemp())
>>> _ = (folder / "points.obj").write_text("v 0 0 0\\nv 9 0 0\\nv 0 9 0\\nv 0 0 9\\nf 1 3 2\\nf 1 2 4\\nf 1 4 3\\nf 2 3 4\\n")
>>> with ThreadPoolExecutor(2) as pool:
...     part = build(folder / "points.obj", folder / "part.brf", client=pool, shards=2, depth=2)
>>> part.sample([[1.0, 1.0, 1.0]])
array([1.], dtype=float32)
"""

from __future__ import annotations

import ctypes
import json
import os
import shutil
import signal
import subprocess
import time
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Any, Callable, Iterable, Iterator, Sequence, Union

from . import Error, Octree, open as open_store, run
from ._program import PROGRAM, PathLike, options_of

__all__ = ["build"]

#: What a shard's program says where the run before it still holds the file.
_HELD = "another process is writing this file"
#: Seconds that a shard waits for such a run to end.
_WAIT = 60.0
#: Settings that say what a run may take. All others are settled by a plan.
_RESOURCES = {"memory", "temp_dir", "commit_every", "restart", "backend", "device", "gpu_memory", "device_check"}


def _end_with_parent() -> None:
    """Ends the program when the worker that started it ends, so that no run holds a shard that another worker takes over."""
    pr_set_pdeathsig = 1
    ctypes.CDLL(None).prctl(pr_set_pdeathsig, signal.SIGKILL)


def _build_shard(arguments: Sequence[str]) -> str:
    """Runs the program on a worker and returns what went wrong, or nothing."""
    until = time.monotonic() + _WAIT
    while True:
        command = [*PROGRAM, *arguments]
        done = subprocess.run(command, capture_output=True, text=True, preexec_fn=_end_with_parent)
        told = done.stderr.strip().splitlines()
        if done.returncode == 0:
            return ""
        what = told[-1].removeprefix("brickfield: ") if told else f"the program ended with {done.returncode}"
        if _HELD not in what or time.monotonic() > until:
            return what
        time.sleep(0.5)


def _workers(client: Any) -> int:
    if hasattr(client, "scheduler_info"):
        return len(client.scheduler_info()["workers"])
    if hasattr(client, "cluster_resources"):
        return int(client.cluster_resources().get("CPU", 1))
    return int(getattr(client, "_max_workers", 1))


def _results(client: Any, shards: dict[int, list[str]], retries: int) -> Iterable[tuple[int, str]]:
    """Numbers of shards with what went wrong, as they finish."""
    if hasattr(client, "scheduler_info"):
        from dask.distributed import as_completed as dask_completed

        futures = {
            client.submit(_build_shard, arguments, retries=retries, pure=False): number
            for number, arguments in shards.items()
        }
        for future in dask_completed(futures):
            error = future.exception() if future.status != "finished" else None
            yield futures[future], future.result() if error is None else f"{future.status}: {error}".splitlines()[0]
        return
    if hasattr(client, "cluster_resources"):
        remote = client.remote(max_retries=retries, retry_exceptions=True)(_build_shard)
        waiting = {remote.remote(arguments): number for number, arguments in shards.items()}
        while waiting:
            for done in client.wait(list(waiting), num_returns=1)[0]:
                number = waiting.pop(done)
                try:
                    yield number, client.get(done)
                except client.exceptions.RayError as error:
                    yield number, str(error).splitlines()[0]
        return
    pending: dict[Future[str], int] = {
        client.submit(_build_shard, arguments): number for number, arguments in shards.items()
    }
    for future in as_completed(pending):
        failure = future.exception()
        yield pending[future], future.result() if failure is None else str(failure).splitlines()[0]


def _is_finished(shard: Path) -> bool:
    try:
        return not run("info", shard)["unfinished"]
    except Error:
        return False


def build(
    inputs: Union[PathLike, Sequence[PathLike]],
    out: PathLike,
    *,
    client: Any = None,
    shards: int | None = None,
    folder: PathLike | None = None,
    retries: int = 2,
    threads: int = 1,
    plan: bool = False,
    progress: Callable[[int, int], None] | None = None,
    **settings: Any,
) -> Octree:
    """Builds a store in shards and opens it.

    ``client`` is a ``dask.distributed.Client``, the module ``ray`` after ``ray.init``, or an executor of
    ``concurrent.futures``; by default a process for each core of this machine. ``shards`` is their number, two a worker by
    default, and ``folder`` where they lie, ``out`` with ``.shards`` by default. ``threads`` are those of one shard. With ``plan``
    one worker reads the inputs and writes a plan into ``folder``, and each shard reads its part of that; of closed meshes. ``progress``
    is called with the number of finished shards and of all. All other arguments are options of ``brickfield build``, with
    underscores: ``depth=7``, ``cell="0.1mm"``, ``memory="4GiB"``.

    Raises ``Error`` that names the first shard that failed, of kind ``program``; or of kind ``setting``, if ``folder`` holds
    shards of another build.
    """
    if client is None:
        with ProcessPoolExecutor(os.cpu_count()) as pool:
            return build(
                inputs, out, client=pool, shards=shards, folder=folder, retries=retries, threads=threads, plan=plan,
                progress=progress, **settings,
            )
    paths = [inputs] if isinstance(inputs, (str, os.PathLike)) else list(inputs)
    files = [Path(path).resolve() for path in paths]
    out = Path(out).resolve()
    place = Path(folder).resolve() if folder is not None else out.with_name(out.name + ".shards")
    count = shards or 2 * max(1, _workers(client))
    options = options_of(settings)
    build_of = {
        "inputs": [[str(file), file.stat().st_size, file.stat().st_mtime_ns] for file in files if file.exists()],
        "options": sorted(map(str, options)),
        "shards": count,
        "plan": plan,
    }
    _take_folder(place, build_of)
    shard = lambda number: place / f"shard-{number}-of-{count}.brf"
    if plan:
        planned = place / "part.plan"
        command = ["build", *map(str, files), "-o", str(planned), "--plan", "--quiet", "--threads", str(threads), *options]
        _make_plan(client, planned, command, retries)
        files, options = [planned], options_of({name: settings[name] for name in _RESOURCES & settings.keys()})
    wanted = {
        number: ["build", *map(str, files), "-o", str(shard(number)), "--shard", f"{number}/{count}", "--quiet"]
        + ["--threads", str(threads), *options]
        for number in range(1, count + 1)
        if not _is_finished(shard(number))
    }
    finished, failed = count - len(wanted), {}
    kept = lambda: f"{finished} of {count} shards are kept in {place}"
    for number, what in _answered(client, wanted, retries, kept):
        if what:
            failed[number] = what
            continue
        finished += 1
        if progress is not None:
            progress(finished, count)
    if failed:
        number = min(failed)
        raise Error(f"shard {number} of {count}: {failed[number]} ({kept()})", "program", str(shard(number)))
    _merge([shard(number) for number in range(1, count + 1)], out)
    shutil.rmtree(place)
    return open_store(out)


def _answered(client: Any, shards: dict[int, list[str]], retries: int, kept: Callable[[], str]) -> Iterator[tuple[int, str]]:
    """As `_results`; a client that is cut off is an error that says what there is."""
    results = iter(_results(client, shards, retries))
    while True:
        try:
            result = next(results)
        except StopIteration:
            return
        except Exception as error:
            what = f"{type(error).__name__} {error}".strip().splitlines()[0]
            raise Error(f"the client does not answer: {what}; call again with another one ({kept()})", "program") from error
        yield result


def _merge(shards: list[Path], out: Path) -> None:
    """Joins the shards. Damaged ones are removed, so that the next call builds them."""
    out.unlink(missing_ok=True)
    try:
        run("cache", "merge", *shards, "-o", out)
    except Error as error:
        for number, shard in enumerate(shards, 1):
            try:
                run("verify", shard)
            except Error as damage:
                shard.unlink(missing_ok=True)
                what = f"shard {number} of {len(shards)}: {damage}; it is removed, the same call builds it again"
                raise Error(what, "program", str(shard)) from error
        raise


def _make_plan(client: Any, planned: Path, command: list[str], retries: int) -> None:
    """Makes a plan on a worker, unless an earlier call has left it."""
    if planned.exists():
        return
    for _, what in _answered(client, {0: command}, retries, lambda: "there is no plan yet"):
        if what:
            raise Error(f"the plan: {what}", "program", str(planned))


def _take_folder(place: Path, build_of: dict[str, Any]) -> None:
    """Makes the folder of the shards, or takes one that holds shards of the same build."""
    told = place / "build.json"
    if told.exists():
        if json.loads(told.read_text()) != build_of:
            what = f"{place}: holds shards of other inputs or settings; give another folder, or remove it"
            raise Error(what, "setting", str(place))
        return
    place.mkdir(parents=True, exist_ok=True)
    told.write_text(json.dumps(build_of))
