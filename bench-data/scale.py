"""How a build's time, memory and disk grow: with facets at one depth, with depth on one file.

    cargo build --release --workspace
    python bench-data/scale.py run --cache CACHE --part part.stl -o scale.json
    pip install matplotlib; python bench-data/scale.py plot scale.json -o bench-data/pictures/scale.svg

The first makes the piles it needs in CACHE (12 GB for all of them), reads each once to warm the page cache, and
builds every case in turn, `--rounds` times around; PART is any large STL for the row of depths. Anonymous memory is
RssAnon of /proc/PID/status, read every 10 ms. The second prints the tables in Markdown and draws the plot.
"""

import argparse
import hashlib
import json
import pathlib
import statistics
import subprocess
import threading
import time

MILLIONS = [1, 2, 5, 10, 20, 45]
DEPTHS = [4, 5, 6, 7]
RELEASE = pathlib.Path(__file__).resolve().parent.parent / "target" / "release"


def watch(process, peak):
    """Keeps the largest RssAnon of a process, in MiB, in peak[0]."""
    while process.poll() is None:
        try:
            for line in open(f"/proc/{process.pid}/status"):
                if line.startswith("RssAnon"):
                    peak[0] = max(peak[0], int(line.split()[1]) / 1024)
        except OSError:
            return
        time.sleep(0.01)


def build(stl, depth, store, memory, threads):
    """One build: seconds, seconds of each phase, peak of anonymous memory, leaves, bytes, hash."""
    command = [RELEASE / "brickfield", "build", stl, "-o", store, "--depth", str(depth), "--json", "--quiet"]
    command += ["--memory", memory, "--threads", str(threads)]
    started, peak = time.perf_counter(), [0.0]
    process = subprocess.Popen(command, stdout=subprocess.PIPE)
    watcher = threading.Thread(target=watch, args=(process, peak))
    watcher.start()
    said = process.stdout.read()
    watcher.join()
    seconds = time.perf_counter() - started
    if process.returncode:
        raise SystemExit(f"{command}: status {process.returncode}")
    with open(store, "rb") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
    return {"seconds": seconds, "anonymous_mib": peak[0], "sha256": digest, "build": json.loads(said)}


def run(options):
    cache = pathlib.Path(options.cache)
    cache.mkdir(parents=True, exist_ok=True)
    cases = []
    for millions in options.millions:
        stl = cache / f"pile{millions}.stl"
        if not stl.exists():
            make = [RELEASE / "make-input", "pile", "--triangles", str(millions * 1_000_000), "-o", stl]
            subprocess.run(make, check=True)
        cases.append({"row": "facets", "file": stl.name, "path": str(stl), "depth": options.depth, "runs": []})
    if options.part:
        for depth in options.depths:
            path = pathlib.Path(options.part)
            cases.append({"row": "depth", "file": path.name, "path": str(path), "depth": depth, "runs": []})
    for path in {case["path"] for case in cases}:
        with open(path, "rb") as file:
            while file.read(1 << 24):
                pass
    store = cache / "scale.brf"
    for _ in range(options.rounds):
        for case in cases:
            case["runs"].append(build(case["path"], case["depth"], store, options.memory, options.threads))
            last = case["runs"][-1]
            print(case["file"], case["depth"], f'{last["seconds"]:.2f} s', f'{last["anonymous_mib"]:.0f} MiB', flush=True)
            store.unlink()
    for case in cases:
        del case["path"]
    json.dump({"memory": options.memory, "threads": options.threads, "cases": cases}, open(options.output, "w"), indent=1)


def row(case):
    """Facets, leaves, median, least and most seconds, memory, bytes of a case."""
    seconds = [r["seconds"] for r in case["runs"]]
    if len({r["sha256"] for r in case["runs"]}) != 1:
        raise SystemExit(f'{case["file"]}, depth {case["depth"]}: runs differ in their bytes')
    said = case["runs"][0]["build"]
    return {
        "facets": said["facets"],
        "leaves": said["leaves"],
        "bytes": said["file_bytes"],
        "median": statistics.median(seconds),
        "least": min(seconds),
        "most": max(seconds),
        "anonymous": max(r["anonymous_mib"] for r in case["runs"]),
        "depth": case["depth"],
    }


def table(rows):
    print("| facets | depth | leaves | time, s | anonymous, MiB | store, MB | µs a facet | ms a leaf |")
    print("|---|---|---|---|---|---|---|---|")
    for r in rows:
        print(
            f'| {r["facets"]:,} | {r["depth"]} | {r["leaves"]:,} | {r["median"]:.2f} ({r["least"]:.2f} to {r["most"]:.2f}) '
            f'| {r["anonymous"]:,.0f} | {r["bytes"] / 1e6:,.0f} | {1e6 * r["median"] / r["facets"]:.2f} '
            f'| {1e3 * r["median"] / r["leaves"]:.2f} |'
        )
    print()


def plot(options):
    import matplotlib

    matplotlib.use("svg")
    matplotlib.rcParams.update({"svg.hashsalt": "scale", "svg.fonttype": "none"})
    import matplotlib.pyplot as plt

    cases = json.load(open(options.results))["cases"]
    figure, axes = plt.subplots(1, 2, figsize=(9, 3.6), sharey=True)
    for axis, name, across, label in [
        (axes[0], "facets", "facets", "facets, depth 5"),
        (axes[1], "depth", "leaves", "leaf bricks, depths 4 to 7 of one file"),
    ]:
        rows = [row(case) for case in cases if case["row"] == name]
        table(rows)
        x, y = [r[across] for r in rows], [r["median"] for r in rows]
        spread = [[r["median"] - r["least"] for r in rows], [r["most"] - r["median"] for r in rows]]
        axis.errorbar(x, y, yerr=spread, marker="o", color="#1f5f8b", label="build")
        # Through the last point with slope one: what grows no faster stays above it to the left.
        axis.plot(x, [y[-1] * v / x[-1] for v in x], "--", color="#999999", label="proportional")
        axis.set_xscale("log")
        axis.set_yscale("log")
        axis.set_xlabel(label)
        axis.grid(True, which="major", alpha=0.3)
        axis.legend(frameon=False)
    axes[0].set_ylabel("seconds")
    figure.tight_layout()
    figure.savefig(options.output, metadata={"Date": None})


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(required=True)
    measure = commands.add_parser("run")
    measure.add_argument("--cache", required=True)
    measure.add_argument("--part")
    measure.add_argument("--millions", type=int, nargs="+", default=MILLIONS)
    measure.add_argument("--depth", type=int, default=5)
    measure.add_argument("--depths", type=int, nargs="+", default=DEPTHS)
    measure.add_argument("--rounds", type=int, default=3)
    measure.add_argument("--memory", default="4GiB")
    measure.add_argument("--threads", type=int, default=2)
    measure.add_argument("-o", "--output", required=True)
    measure.set_defaults(do=run)
    draw = commands.add_parser("plot")
    draw.add_argument("results")
    draw.add_argument("-o", "--output", required=True)
    draw.set_defaults(do=plot)
    options = parser.parse_args()
    options.do(options)


if __name__ == "__main__":
    main()
