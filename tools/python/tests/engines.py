#!/usr/bin/env python3
"""Builds in shards on Dask and Ray, with a worker killed midway; needs dask, distributed and ray beside the package.

    python tools/python/tests/engines.py INPUT [--depth 5] [--shards 8] [--kill] [--plan] [--rounds 3]

Compares the stores with one build, byte by byte, and prints seconds. The same shards in processes of this machine, none of
them killed, tell what shards cost beside one build. Engines that are not installed are named.
"""

import argparse
import hashlib
import os
import resource
import signal
import statistics
import sys
import tempfile
import threading
import time
from pathlib import Path

from brickfield import Error, run
from brickfield.distributed import build


# Seconds to wait for a worker to begin a shard.
PATIENCE = 3600
# The outputs for which one was killed.
KILLED = []


def hash_of(path):
    return hashlib.sha256(Path(path).read_bytes()).hexdigest()


def processor_seconds():
    """Of this process and of those that it has waited for, with theirs."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(one.ru_utime + one.ru_stime for one in used)


def kill_one(parents, name):
    """Kills a worker once it runs the program: the parent of a process whose command has these words."""
    ends = time.time() + PATIENCE
    while time.time() < ends:
        time.sleep(0.02)
        for entry in os.listdir("/proc"):
            try:
                words = Path(f"/proc/{entry}/cmdline").read_bytes().split(b"\0") if entry.isdigit() else []
                parent = int(Path(f"/proc/{entry}/stat").read_text().rsplit(")")[-1].split()[1]) if words else 0
            except OSError:
                continue
            if b"--shard" in words and name.encode() in b" ".join(words) and parent in parents():
                os.kill(parent, signal.SIGKILL)
                print(f"  killed worker {parent}, which built a shard")
                KILLED.append(name)
                return


def checked(engine, expected, args, folder, client, parents):
    out = folder / f"{engine}.brf"
    if args.kill and parents is not None:
        threading.Thread(target=kill_one, args=(parents, out.name), daemon=True).start()
    begun, steps = time.time(), []
    build(args.input, out, client=client, shards=args.shards, depth=args.depth, plan=args.plan,
          progress=lambda *n: steps.append(n))
    if args.kill and parents is not None and out.name not in KILLED:
        print(f"{engine}: NO WORKER WAS KILLED")
        return False
    same = hash_of(out) == expected and steps[-1] == (args.shards, args.shards)
    print(f"{engine}: {time.time() - begun:.1f} s, {'the bytes of one build' if same else 'OTHER BYTES'}")
    return same


def processes(expected, args, folder):
    """Two processes of this machine, which are waited for: all that they use is known."""
    from concurrent.futures import ProcessPoolExecutor

    with ProcessPoolExecutor(2) as pool:
        return checked("processes", expected, args, folder, pool, None)


def dask(expected, args, folder):
    from dask.distributed import Client, LocalCluster

    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster, Client(cluster) as client:
        parents = lambda: {worker.pid for worker in cluster.workers.values() if worker.pid}
        return checked("dask", expected, args, folder, client, parents)


def on_ray(expected, args, folder):
    import ray

    ray.init(num_cpus=2, include_dashboard=False, log_to_driver=False)
    try:
        # Workers of Ray name themselves after the task.
        parents = lambda: {int(p) for p in os.listdir("/proc") if p.isdigit() and is_ray(p)}
        return checked("ray", expected, args, folder, ray, parents)
    finally:
        ray.shutdown()


def is_ray(process):
    try:
        return Path(f"/proc/{process}/cmdline").read_bytes().startswith(b"ray::")
    except OSError:
        return False


def refusals(args, folder):
    """What fails keeps its finished shards, and names the shard."""
    from concurrent.futures import ThreadPoolExecutor

    with ThreadPoolExecutor(2) as pool:
        try:
            build(folder / "missing.stl", folder / "m.brf", client=pool, shards=2)
            return False
        except Error as error:
            print(f"refused: {error}")
            if "shard 1 of 2" not in str(error):
                return False
        try:
            build(args.input, folder / "m.brf", client=pool, shards=2)
            return False
        except Error as error:
            print(f"refused: {error}")
            return "other inputs or settings" in str(error)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("input", type=Path)
    parser.add_argument("--depth", type=int, default=4)
    parser.add_argument("--shards", type=int, default=8)
    parser.add_argument("--kill", action="store_true")
    parser.add_argument("--plan", action="store_true", help="read the input once; of closed meshes")
    parser.add_argument("--rounds", type=int, default=1, help="of one build and its shards in processes, by turns")
    args = parser.parse_args()
    # Stores hold the name of their input, and shards are built by its whole path.
    args.input = args.input.resolve()
    good = True
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        ratios = []
        for _ in range(args.rounds):
            begun, before = time.time(), processor_seconds()
            run("build", args.input, "-o", folder / "one.brf", "--restart", "--depth", str(args.depth))
            alone = processor_seconds() - before
            print(f"one build: {time.time() - begun:.1f} s, {alone:.1f} s of processor")
            expected = hash_of(folder / "one.brf")
            before = processor_seconds()
            good &= processes(expected, args, folder)
            used = processor_seconds() - before
            ratios.append(used / alone)
            print(f"  {used:.1f} s of processor, {ratios[-1]:.2f} times one build", flush=True)
            (folder / "one.brf").unlink()
        print(f"median of {args.rounds}: {statistics.median(ratios):.2f} times one build")
        for engine in (dask, on_ray):
            try:
                good &= engine(expected, args, folder)
            except ImportError as error:
                print(f"{engine.__name__}: not installed ({error})")
        good &= refusals(args, folder)
    sys.exit(0 if good else 1)


if __name__ == "__main__":
    main()
