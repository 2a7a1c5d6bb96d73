#!/usr/bin/env python3
"""One line of a toolpath is not laid: does `brickfield voids` find what it leaves, and name the lines beside it first?

    python3 bench-data/missing_lines.py --program target/release/brickfield --trials 67 TOOLPATH.gcode ...

Lines are drawn with a fixed seed among those of solid infill and of inner perimeters. A trial is a line that others
enclose: they lie on both sides, before both ends, below and above; without it there is a channel as large as a bead. What others would leave opens to the
outside or to cells of sparse infill: these are counted as drawn. Only what lies near the line is built: some layers, and the moves within a few millimetres of it; all
others become travels. Needs numpy. Prints a table; exit status 1 if a void is not found or not traced.
"""

import argparse
import collections
import json
import math
import pathlib
import subprocess
import sys
import tempfile
import time

import numpy as np

Move = collections.namedtuple("Move", "line layer feature width start end words laid")


def run(program, *arguments):
    done = subprocess.run([program, *map(str, arguments)], capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"{' '.join(map(str, arguments))}: {done.stderr.strip()}")
    return done.stdout


def read(text):
    """All moves in the plane, with what they lay; `line` counts from 0."""
    feature, width, layer, place, e = "", 0.0, -1, [0.0, 0.0], 0.0
    relative, found = any(line.startswith("M83") for line in text), []
    for number, line in enumerate(text):
        if line.startswith(";TYPE:"):
            feature = line[6:].strip()
        elif line.startswith(";WIDTH:"):
            width = float(line[7:])
        elif line.startswith(";LAYER_CHANGE"):
            layer += 1
        elif line.startswith(("G0 ", "G1 ", "G92 ")):
            words = {w[0]: float(w[1:]) for w in line.split(";")[0].split()[1:]}
            amount = 0.0 if "E" not in words else words["E"] if relative else words["E"] - e
            e = words.get("E", e)
            if {"X", "Y"} & words.keys() and not line.startswith("G92"):
                end = [words.get(a, place[n]) for n, a in enumerate("XY")]
                found.append(Move(number, layer, feature, width, place, end, words, amount > 0 and place != end))
                place = end
    return found, relative


def away(point, move):
    """The distance of a place from a move, and on which side of `along` it lies is told by the caller."""
    a, b = np.array(move.start), np.array(move.end)
    square = (b - a) @ (b - a)
    t = np.clip((point - a) @ (b - a) / square, 0, 1) if square else 0.0
    nearest = a + t * (b - a)
    return np.linalg.norm(point - nearest), nearest


def beside(move, layer):
    """The lines of a layer beside a move, by side: at its width or little more from one of its inner places."""
    a, b = np.array(move.start), np.array(move.end)
    along = (b - a) / np.linalg.norm(b - a)
    sides, covered = (set(), set()), [0, 0]
    places = np.linspace(0.1, 0.9, 17)
    for t in places:
        here, faced = a + t * (b - a), [False, False]
        for other in layer:
            if other.line == move.line:
                continue
            distance, nearest = away(here, other)
            across = nearest - here
            if 0.3 * move.width < distance < 1.3 * move.width and abs(across @ along) < 0.5 * distance:
                side = int(along[0] * across[1] - along[1] * across[0] > 0)
                sides[side].add(other.line)
                faced[side] = True
        covered = [c + f for c, f in zip(covered, faced)]
    return sides, min(covered) / len(places)


def walled(move, layer):
    """Whether lines lie before both ends of a move: else its channel is open along its whole width."""
    a, b = np.array(move.start), np.array(move.end)
    along = (b - a) / np.linalg.norm(b - a)
    aside = np.array([-along[1], along[0]])
    before = [place + move.width * (0.75 * way * along + side * aside)
              for place, way in ((a, -1), (b, 1)) for side in (-0.4, 0, 0.4)]
    return all(any(away(place, other)[0] < 0.5 * other.width for other in layer if other.line != move.line)
               for place in before)


def covered(move, layer):
    """The share of a move, with its round ends, that the lines of another layer cross or cover. Bridges have gaps."""
    a, b = np.array(move.start), np.array(move.end)
    end = 0.5 * move.width / np.linalg.norm(b - a)
    places = [a + t * (b - a) for t in np.linspace(-end, 1 + end, 21)]
    boxes = [(other, *away_box(other)) for other in layer if "ridge" not in other.feature]
    hit = 0
    for here in places:
        hit += any((here >= low).all() and (here <= high).all() and away(here, other)[0] < 0.55 * other.width
                   for other, low, high in boxes)
    return hit / len(places)


def away_box(move):
    return np.minimum(move.start, move.end) - move.width, np.maximum(move.start, move.end) + move.width


def near(text, moves, relative, gone, args):
    """The program around a move, without it; and the number in `text` of each of its lines, both from 0."""
    changes = [n for n, line in enumerate(text) if line.startswith(";LAYER_CHANGE")] + [len(text)]
    layers = range(max(gone.layer - args.layers, 0), min(gone.layer + args.layers + 1, len(changes) - 1))
    low = np.minimum(gone.start, gone.end) - args.around
    high = np.maximum(gone.start, gone.end) + args.around
    of = {move.line: move for move in moves}
    lines, numbers = [], []

    def put(line, number):
        lines.append(line)
        numbers.append(number)

    head = [line for line in text[:changes[0]] if not line.startswith(("G0 ", "G1 "))]
    for number, line in enumerate(head):
        put(line, number)
    e = next((line.split("E")[1].split()[0] for line in reversed(text[:changes[layers[0]]])
              if line.startswith(("G1 ", "G92 ")) and " E" in line), "0")
    put(f"G92 E{e}", -1)
    for number in range(changes[layers[0]], changes[layers[-1] + 1]):
        move = of.get(number)
        if move is None or not move.laid:
            put(text[number], number)
            continue
        is_near = (np.minimum(move.start, move.end) <= high).all() and (np.maximum(move.start, move.end) >= low).all()
        if is_near and number != gone.line:
            put(text[number], number)
        else:
            put(f"G0 X{move.end[0]} Y{move.end[1]}", number)
            if not relative:
                put(f"G92 E{move.words['E']}", number)
    return lines, numbers


def candidates(moves, args):
    """Lines of wanted features and length, inside of the part, that lines lie beside."""
    last = max(move.layer for move in moves if move.laid)
    layers = collections.defaultdict(list)
    for move in moves:
        if move.laid:
            layers[move.layer].append(move)
    return [m for m in moves if m.laid and m.feature in args.features and args.below <= m.layer <= last - args.below
            and math.dist(m.start, m.end) >= args.length], layers


def judge(rows, numbers, gone, sides):
    """Whether a void holds the line's middle and names lines of both sides, and first; and the row."""
    middle = (np.array(gone.start) + gone.end) / 2
    best = ((0, 0, 0), None)
    for row in rows:
        holds = all(row[a + "min"] - 0.1 <= middle[n] <= row[a + "max"] + 0.1 for n, a in enumerate("xy"))
        lines = [numbers[int(line.split("-")[0]) - 1] for line in (row["lines"] or "").split(";") if line]
        pairs = [[numbers[int(n) - 1] for n in pair.split("-")] for pair in (row["missing_between"] or "").split(";") if pair]
        of_both = [p for p in pairs if any(p[0] in sides[s] and p[1] in sides[1 - s] for s in (0, 1))]
        touches = all(side & set(lines) for side in sides)
        first = lines[:2]
        is_first = len(first) == 2 and any(first[0] in sides[s] and first[1] in sides[1 - s] for s in (0, 1))
        state = (int(holds and touches), int(holds and touches and bool(of_both)), int(holds and touches and is_first))
        if state > best[0]:
            best = (state, row)
    return best


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", default="target/release/brickfield")
    parser.add_argument("--trials", type=int, default=20, help="of each toolpath")
    parser.add_argument("--cell", default="0.05mm")
    parser.add_argument("--closing", default="0.25mm")
    parser.add_argument("--least", default="0.1", help="volume of the smallest void, mm³")
    parser.add_argument("--layers", type=int, default=2, help="built below and above")
    parser.add_argument("--below", type=int, default=3, help="layers that must lie below and above")
    parser.add_argument("--around", type=float, default=2.0, help="millimetres around the line that are built")
    parser.add_argument("--length", type=float, default=4.0)
    parser.add_argument("--features", nargs="*", default=["Solid infill", "Perimeter"])
    parser.add_argument("--seed", type=int, default=5)
    parser.add_argument("--show", action="store_true")
    parser.add_argument("--keep", type=pathlib.Path)
    parser.add_argument("toolpaths", nargs="+", type=pathlib.Path)
    args = parser.parse_args()
    bad = 0
    print("| toolpath | feature | drawn | enclosed | found | both neighbours named | named first | as a void of its own | s a trial |")
    print("|---|---|---|---|---|---|---|---|---|", flush=True)
    for toolpath in args.toolpaths:
        random = np.random.default_rng(args.seed)
        text = toolpath.read_text().splitlines()
        moves, relative = read(text)
        lines, layers = candidates(moves, args)
        drawn, tally, began = collections.Counter(), collections.defaultdict(lambda: np.zeros(5, int)), time.time()
        for n in random.permutation(len(lines)):
            if sum(t[0] for t in tally.values()) == args.trials:
                break
            gone = lines[n]
            drawn[gone.feature] += 1
            sides, share = beside(gone, layers[gone.layer])
            if share < 0.9 or not walled(gone, layers[gone.layer]) or any(covered(gone, layers[gone.layer + up]) < 0.95 for up in (-1, 1)):
                continue
            with tempfile.TemporaryDirectory() as folder:
                folder = args.keep or pathlib.Path(folder)
                program, numbers = near(text, moves, relative, gone, args)
                path, store, out = folder / "d.gcode", folder / "d.brf", folder / "d.json"
                path.write_text("\n".join(program) + "\n")
                run(args.program, "build", path, "-o", store, "--identity", "-q", "--cell", args.cell)
                run(args.program, "voids", store, "-o", out, "-q", "--closing", args.closing, "--min-volume", args.least)
                rows = json.loads(out.read_text())["voids"]
            state, row = judge(rows, numbers, gone, sides)
            # Its own: no longer and wider than the line with the beads beside it.
            own = row is not None and max(row[a + "max"] - row[a + "min"] for a in "xy") \
                < math.dist(gone.start, gone.end) + 4 * gone.width
            tally[gone.feature] += [1, *state, own]
            bad += 3 - sum(state)
            if args.show and sum(state) < 3:
                shown = row and {k: str(row[k])[:80] for k in ("volume", "class", "sealed", "throat", "lines", "missing_between")}
                print(f"line {gone.line + 1} {gone.feature} {math.dist(gone.start, gone.end):.1f} mm, layer {gone.layer}: {state}, "
                      f"{[sorted(n + 1 for n in s)[:6] for s in sides]} {len(rows)} voids, {shown}, "
                      f"{[[numbers[int(l.split('-')[0]) - 1] + 1 for l in (row['lines'] or '').split(';')[:4] if l] for row in [row] if row]}", flush=True)
        each = (time.time() - began) / max(1, args.trials)
        for feature, t in sorted(tally.items()):
            print(f"| {toolpath.name} | {feature} | {drawn[feature]} | {' | '.join(map(str, t))} | {each:.1f} |", flush=True)
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
