#!/usr/bin/env python3
"""Runs brickfield over any folder of files, each command with a limit of time and memory, and prints a table.

For collections of inputs that may not be committed: nothing is written beside them, and stores go to a temporary
folder. A row is a file and a command; the columns are

    file, kind, command, result, status, warnings, seconds, mib, message

`result` is ok, refused (one line on standard error says why), PANIC, TIMEOUT, MEMORY, SIGNAL n, or BAD MESSAGE, an
error that is not told in one line. The exit status is 1 if any result is written in capitals.

Example:
    bench-data/corpus.py ~/parts --program target/release/brickfield --check --csv table.csv
"""

import argparse
import csv
import json
import os
import resource
import signal
import subprocess
import sys
import tempfile
import threading
import time

COLUMNS = ["file", "kind", "command", "result", "status", "warnings", "seconds", "mib", "message"]
MIB = 1 << 20


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("paths", nargs="+", help="files, and folders that are searched with all below them")
    parser.add_argument("--program", default="brickfield", help="the program to run [default: brickfield]")
    parser.add_argument("--seconds", type=float, default=60.0, help="limit of each command [default: 60]")
    parser.add_argument("--mib", type=int, default=4096, help="limit of its address space [default: 4096]")
    parser.add_argument("--depth", default="3", help="depth of the stores, or auto for the program's choice [default: 3]")
    parser.add_argument("--endings", help="only files with these endings, as in stl,ply,gcode")
    parser.add_argument("--check", action="store_true", help="also run `mesh --check` on meshes")
    parser.add_argument("--no-build", action="store_true", help="run `info` alone")
    parser.add_argument("--csv", metavar="FILE", help="also write the table as CSV")
    parser.add_argument("--json", metavar="FILE", help="also write the table as JSON")
    return parser.parse_args()


def files(paths, endings):
    """All files, in an order that does not depend on the file system."""
    found = []
    for path in paths:
        if not os.path.isdir(path):
            found.append(path)
            continue
        for folder, folders, names in os.walk(path):
            folders.sort()
            found.extend(os.path.join(folder, name) for name in sorted(names))
    wanted = {ending.strip().lower().lstrip(".") for ending in (endings or "").split(",") if ending.strip()}
    return [path for path in found if not wanted or os.path.splitext(path)[1].lower().lstrip(".") in wanted]


def limit(args):
    """What the child sets for itself before it becomes the program."""
    def apply():
        resource.setrlimit(resource.RLIMIT_AS, (args.mib * MIB, args.mib * MIB))
        seconds = int(args.seconds * 64) + 1
        resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    return apply


class Ran:
    """What a command did."""

    def __init__(self, args, words):
        with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as errors:
            started = time.monotonic()
            child = subprocess.Popen(
                [args.program, *words], stdin=subprocess.DEVNULL, stdout=out, stderr=errors, preexec_fn=limit(args)
            )
            self.timed_out = False

            def stop():
                self.timed_out = True
                child.send_signal(signal.SIGKILL)

            timer = threading.Timer(args.seconds, stop)
            timer.start()
            # Its own use of memory, not the largest of all children so far.
            _, status, usage = os.wait4(child.pid, 0)
            timer.cancel()
            child.returncode = os.waitstatus_to_exitcode(status)
            self.seconds = time.monotonic() - started
            self.status = child.returncode
            self.mib = usage.ru_maxrss / 1024
            for stream in (out, errors):
                stream.seek(0)
            self.out = out.read(MIB * 16).decode("utf-8", "replace")
            self.errors = errors.read(MIB).decode("utf-8", "replace").splitlines()

    def row(self, path, kind, command):
        warnings = [line for line in self.errors if line.startswith("brickfield: warning: ")]
        others = [line for line in self.errors if line not in warnings and line.strip()]
        text = "\n".join(self.errors)
        # The runtime's last words where no memory is left.
        no_memory = "memory allocation of" in text or "Cannot allocate memory" in text
        if self.timed_out:
            result = "TIMEOUT"
        elif no_memory:
            result = "MEMORY"
        elif self.status == 101 or "panicked at" in text:
            result = "PANIC"
        elif self.status < 0:
            result = f"SIGNAL {-self.status}"
        elif self.status == 0:
            result = "ok" if not others else "BAD MESSAGE"
        else:
            result = "refused" if len(others) == 1 or self.status == 2 else "BAD MESSAGE"
        message = others[0] if others else warnings[0] if warnings else ""
        message = message.removeprefix("brickfield: ").removeprefix("warning: ")
        return {
            "file": path,
            "kind": kind,
            "command": command,
            "result": result,
            "status": self.status,
            "warnings": len(warnings),
            "seconds": round(self.seconds, 3),
            "mib": round(self.mib, 1),
            "message": message.replace(path + ": ", ""),
        }


def kind_of(ran):
    """The format that `info --json` gives."""
    try:
        said = json.loads(ran.out)
    except ValueError:
        return "?"
    return str(said.get("format") or ("store" if "store" in said else "?"))


def rows_of(args, path, folder):
    """The rows of one file, each as soon as its command has ended."""
    info = Ran(args, ["info", path, "--json"])
    kind = kind_of(info)
    yield info.row(path, kind, "info")
    if kind == "store":
        return
    if not args.no_build:
        store = os.path.join(folder, "part.brf")
        depth = [] if args.depth == "auto" else ["--depth", args.depth]
        yield Ran(args, ["build", path, "-o", store, *depth, "--quiet"]).row(path, kind, "build")
        for name in os.listdir(folder):
            os.remove(os.path.join(folder, name))
    if args.check and kind.startswith(("STL", "OBJ", "PLY")) and "points" not in kind:
        yield Ran(args, ["mesh", "--check", path, "--quiet"]).row(path, kind, "check")


def text_of(row):
    name = row["file"] if len(row["file"]) <= 48 else "..." + row["file"][-45:]
    return (
        f"{name:<48} {row['kind']:<24} {row['command']:<6} {row['result']:<12} {row['warnings']:>4} "
        f"{row['seconds']:>8.2f} {row['mib']:>8.1f}  {row['message'][:160]}"
    ).rstrip()


def main():
    args = arguments()
    rows = []
    print(f"{'file':<48} {'kind':<24} {'does':<6} {'result':<12} {'warn':>4} {'seconds':>8} {'MiB':>8}  message")
    with tempfile.TemporaryDirectory(prefix="brickfield-corpus-") as folder:
        for path in files(args.paths, args.endings):
            for row in rows_of(args, path, folder):
                rows.append(row)
                print(text_of(row), flush=True)
    counts = {}
    for row in rows:
        counts[row["result"]] = counts.get(row["result"], 0) + 1
    print(", ".join(f"{count} {result}" for result, count in sorted(counts.items())) or "no files")
    if args.csv:
        with open(args.csv, "w", newline="", encoding="utf-8") as out:
            writer = csv.DictWriter(out, COLUMNS)
            writer.writeheader()
            writer.writerows(rows)
    if args.json:
        with open(args.json, "w", encoding="utf-8") as out:
            json.dump({"rows": rows, "counts": counts}, out, indent=1)
            out.write("\n")
    return 1 if any(row["result"][0].isupper() for row in rows) else 0


if __name__ == "__main__":
    sys.exit(main())
