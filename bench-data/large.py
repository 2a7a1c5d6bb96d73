#!/usr/bin/env python3
"""One large pile of beads through every command: time, memory and size of each, beside reading the store.

    cargo build --release && cargo build --release -p brickfield-bench-data
    bench-data/large.py --facets 45000000 --depth 6 --cpus 0,1 --folder /tmp/large
    bench-data/large.py --only build,info,voids --facets 1000000 --depth 5

Prints a row of a Markdown table as each step ends; exit status 1 if something that must hold does not, or a step
failed. Memory is the largest RssAnon, looked at every 10 ms: maps of files are not in it.
"""

import argparse
import hashlib
import os
import pathlib
import random
import resource
import struct
import subprocess
import sys
import threading
import time

HERE = pathlib.Path(__file__).resolve().parent
FACET = 50
HEADER = 84


class Steps:
    """What is run, and what has to hold of it."""

    def __init__(self, options):
        self.options = options
        self.folder = pathlib.Path(options.folder)
        self.folder.mkdir(parents=True, exist_ok=True)
        self.reading = None
        self.failed = False
        print("| step | s | processor, s | × reading | memory, MiB | written, MB | |\n|---|---|---|---|---|---|---|")

    def wanted(self, step):
        return not self.options.only or step in self.options.only.split(",")

    def path(self, name):
        return self.folder / name

    def run(self, name, *arguments, output=None, program=None, cpus=None, threads=None, note=None, fails=False):
        """Runs the program to its end, or for the limit, and prints the row. What it printed comes back."""
        program = program or self.options.program
        cpus = cpus or self.options.cpus
        command = ["taskset", "-c", cpus] if cpus else []
        command += [program, *map(str, arguments)]
        if threads:
            command += ["--threads", str(threads)]
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        began = time.time()
        child = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        most = Memory(child.pid)
        try:
            printed, errors = child.communicate(timeout=self.options.limit)
        except subprocess.TimeoutExpired:
            child.kill()
            printed, errors = child.communicate()
            errors = f"stopped after {self.options.limit} s"
        seconds = time.time() - began
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        processor = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        said = errors.strip().splitlines()[-1] if child.returncode and errors.strip() else ""
        written = sum(size(path) for path in ([output] if output and output.exists() else []))
        if name == "info --volume":
            self.reading = processor
        ratio = f"{processor / self.reading:.2f}" if self.reading else ""
        note = said or (note(printed) if note else "")
        megabytes = f"{written / 1e6:.1f}" if written else ""
        print(f"| {name} | {seconds:.2f} | {processor:.2f} | {ratio} | {most.end():.0f} | {megabytes} | {note} |", flush=True)
        if child.returncode and not fails:
            self.failed = True
        if child.returncode < 0 and output:
            # What an unfinished build left.
            for part in output.parent.glob(output.name + ".*"):
                part.unlink()
        return printed

    def must(self, holds, what):
        if not holds:
            self.failed = True
            print(f"FAILED: {what}", flush=True)


class Memory:
    """The largest RssAnon of a process, in MiB."""

    def __init__(self, process):
        self.path = f"/proc/{process}/status"
        self.most = 0
        self.ended = threading.Event()
        self.thread = threading.Thread(target=self.watch)
        self.thread.start()

    def watch(self):
        while not self.ended.wait(0.01):
            try:
                for line in open(self.path):
                    if line.startswith("RssAnon:"):
                        self.most = max(self.most, int(line.split()[1]))
            except OSError:
                return

    def end(self):
        self.ended.set()
        self.thread.join()
        return self.most / 1024


def size(path):
    if path.is_dir():
        return sum(part.stat().st_size for part in path.rglob("*") if part.is_file())
    return path.stat().st_size


def digest(path):
    """The hash of a file's bytes."""
    sums = hashlib.blake2b()
    with open(path, "rb") as file:
        while part := file.read(1 << 24):
            sums.update(part)
    return sums.hexdigest()


def less(source, target, lost):
    """Copies a binary STL less some facets, chosen at random with a fixed seed."""
    with open(source, "rb") as file, open(target, "wb") as out:
        header = file.read(HEADER)
        facets = struct.unpack("<I", header[80:])[0]
        out.write(header[:80] + struct.pack("<I", facets - lost))
        at = 0
        for gone in sorted(random.Random(1).sample(range(facets), lost)) + [facets]:
            left = (gone - at) * FACET
            while left:
                part = file.read(min(left, 1 << 24))
                out.write(part)
                left -= len(part)
            file.seek(FACET, 1)
            at = gone + 1


def program_of_moves(path, moves):
    """A milling program that faces the pile's top in straight rows, a little deeper in each pass."""
    rows = 100
    lines = ["G90 G17 G21", "F1200"]
    z, count = 11.5, 0
    while count < moves:
        lines.append(f"G0 X-5 Y0 Z{z + 5:.4f}")
        lines.append(f"G1 Z{z:.4f}")
        for row in range(rows):
            y = row * 100 / (rows - 1)
            ends = (-5, 105) if row % 2 == 0 else (105, -5)
            steps = 10
            for step in range(steps + 1):
                x = ends[0] + (ends[1] - ends[0]) * step / steps
                lines.append(f"G1 X{x:.4f} Y{y:.4f} Z{z + 0.05 * ((row + step) % 3):.4f}")
                count += 1
        lines.append(f"G0 Z{z + 5:.4f}")
        z -= 0.1
    path.write_text("\n".join(lines) + "\nM30\n")


def stores(steps):
    """The pile and its store; the store's bytes for other numbers of threads."""
    options = steps.options
    pile, store = steps.path("pile.stl"), steps.path("part.brf")
    if not pile.exists():
        steps.run("pile", "pile", "--triangles", options.facets, "-o", pile, output=pile, program=options.make_input)
    if steps.wanted("build") or not store.exists():
        steps.run("build", "build", pile, "--depth", options.depth, "--memory", options.memory, "-q", "-o", store,
                  output=store)
    if steps.wanted("info"):
        steps.run("info --volume", "info", store, "--volume")
    if steps.wanted("all"):
        other = steps.path("other.brf")
        steps.run("build, all processors", "build", pile, "--depth", options.depth, "-q", "-o", other, output=other, cpus=every())
        steps.must(digest(store) == digest(other), "stores of two numbers of threads differ")
        other.unlink()
    return pile, store


def every():
    return f"0-{os.cpu_count() - 1}"


def found(steps, store):
    """Voids, the same for each number of threads."""
    if steps.wanted("voids"):
        hashes = set()
        for threads in (os.cpu_count(), 3):
            table = steps.path("voids.csv")
            steps.run(f"voids, {threads} threads", "voids", store, "-q", "--memory", "512MiB", "-o", table, output=table,
                      threads=threads, cpus=every(), note=lambda _: f"{sum(1 for _ in open(table)) - 1:,} voids")
            hashes.add(digest(table))
        steps.must(len(hashes) == 1, "tables of voids differ")
    if steps.wanted("layers"):
        table = steps.path("layers.csv")
        steps.run("layers", "layers", store, "-q", "-o", table, output=table, fails=True)


def written(steps, store):
    """Copies of the store in its own and in other formats."""
    if steps.wanted("repack"):
        steps.run("cache repack", "cache", "repack", store, "-q", "-o", steps.path("again.brf"), output=steps.path("again.brf"))
        steps.path("again.brf").unlink(missing_ok=True)
    if steps.wanted("export"):
        for name, more in (("w.vdb", []), ("w.vtkhdf", []), ("w.zarr", []), ("sdf.vdb", ["--as", "sdf"])):
            out = steps.path(name)
            steps.run(f"export {name}", "export", store, "-q", *more, "-o", out, output=out)
            if out.is_file():
                out.unlink()
    if steps.wanted("splats"):
        out = steps.path("part.bsp")
        steps.run("splats", "splats", store, "-q", "-o", out, output=out)
        out.unlink(missing_ok=True)


def meshes(steps, store):
    if not steps.wanted("mesh"):
        return
    for triangles in (10_000, 100_000, 1_000_000):
        out = steps.path("mesh.stl")
        steps.run(f"mesh --triangles {triangles:,}", "mesh", store, "-q", "--triangles", triangles, "-o", out, output=out,
                  note=lambda _: f"{(out.stat().st_size - HEADER) // FACET:,} triangles")
        if out.exists():
            steps.run("its check", "mesh", "--check", out, note=lambda printed: "; ".join(printed.split("\n")[-3:]).strip("; "))
            out.unlink()


def cuts(steps, store):
    if not steps.wanted("machine"):
        return
    moves = steps.path("moves.nc")
    program_of_moves(moves, 10_000)
    out = steps.path("cut.brf")
    steps.run("machine, 10,000 moves", "machine", store, moves, "--tool", "ball:6mm", "-q", "--memory", "1GiB", "-o", out, output=out)
    out.unlink(missing_ok=True)
    steps.run("csg --minus a half-space", "csg", store, "--minus", "z>10mm", "-q", "--memory", "1GiB", "-o", out, output=out)
    out.unlink(missing_ok=True)


def distances(steps, pile, store):
    """Offsets, walls and deviations, on a store one level coarser."""
    if not steps.wanted("distance"):
        return
    coarse = steps.path("coarse.brf")
    steps.run("build, one level less", "build", pile, "--depth", steps.options.depth - 1, "--memory", steps.options.memory, "-q",
              "-o", coarse, output=coarse)
    out = steps.path("grown.brf")
    steps.run("offset --by 0.1mm, one level less", "offset", coarse, "--by", "0.1mm", "-q", "--memory", "1GiB", "-o", out,
              output=out, cpus=every())
    out.unlink(missing_ok=True)
    out = steps.path("walls.ply")
    steps.run("thickness, one level less", "thickness", coarse, "-q", "--memory", "1GiB", "-o", out, output=out, cpus=every())
    out.unlink(missing_ok=True)
    steps.run("deviation of it from the store", "deviation", coarse, store, "-q", "--memory", "1GiB", "-o", out, output=out,
              cpus=every())
    out.unlink(missing_ok=True)


def opened(steps, pile):
    """The pile less some facets, beside the whole one, one level less than the store and at its level."""
    if not steps.wanted("open"):
        return
    for depth in (steps.options.depth - 1, steps.options.depth):
        out = steps.path("open.brf")
        steps.run(f"build, depth {depth}, whole", "build", pile, "--depth", depth, "--memory", steps.options.memory, "-q", "-o", out,
                  output=out)
        out.unlink(missing_ok=True)
        for lost in (1, 100, 10_000):
            soup = steps.path(f"less{lost}.stl")
            if not soup.exists():
                less(pile, soup, lost)
            steps.run(f"build, depth {depth}, less {lost:,}", "build", soup, "--depth", depth, "--memory", steps.options.memory,
                      "-q", "-o", out, output=out, fails=True)
            for left in steps.folder.glob("open.brf*"):
                left.unlink()


def shards(steps, pile, store):
    """A plan, and eight shards of it one after another, joined."""
    if not steps.wanted("shards"):
        return
    plan = steps.path("part.plan")
    steps.run("build --plan", "build", pile, "--depth", steps.options.depth, "--plan", "--memory", steps.options.memory,
              "-q", "-o", plan, output=plan)
    parts = [steps.path(f"part-{i}.brf") for i in range(1, 9)]
    for i, part in enumerate(parts, 1):
        steps.run(f"build --shard {i}/8", "build", plan, "--shard", f"{i}/8", "--memory", steps.options.memory, "-q", "-o",
                  part, output=part)
    out = steps.path("merged.brf")
    steps.run("cache merge", "cache", "merge", *parts, "-q", "-o", out, output=out)
    steps.must(out.exists() and digest(out) == digest(store), "the joined shards are not the store")
    for path in [plan, out, *parts]:
        path.unlink(missing_ok=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    release = HERE.parent / "target/release"
    parser.add_argument("--program", default=str(release / "brickfield"))
    parser.add_argument("--make-input", default=str(release / "make-input"))
    parser.add_argument("--facets", type=int, default=45_000_000)
    parser.add_argument("--depth", type=int, default=6)
    parser.add_argument("--memory", default="1GiB", help="for builds")
    parser.add_argument("--cpus", help="processors to run on, as in 0,1; all by default")
    parser.add_argument("--folder", default="large")
    parser.add_argument("--limit", type=float, default=600, help="seconds that a step may take")
    parser.add_argument("--only", help="steps, with commas: build, info, all, voids, layers, repack, export, splats, mesh, machine, "
                        "distance, open, shards")
    options = parser.parse_args()
    steps = Steps(options)
    pile, store = stores(steps)
    found(steps, store)
    meshes(steps, store)
    written(steps, store)
    cuts(steps, store)
    shards(steps, pile, store)
    opened(steps, pile)
    distances(steps, pile, store)
    sys.exit(1 if steps.failed else 0)


main()
