#!/usr/bin/env python3
"""What each beginning of a file of splats shows: bytes, splats, and how near its picture is to that of the whole file.

    splats.py BRICKFIELD PART.bsp [--size 800x800]
    splats.py BRICKFIELD PART.brf --holes [--size 640x480]

Draws every level with `render --splats` and compares: the ratio of signal to noise of the luminance (PSNR), and which pixels
are background in one picture only. With `--holes` the finest splats of a store beside rays through it, in twelve views, most of
them grazing: pixels that splats leave empty a pixel or more within the part, and pixels of splats a pixel or more beside it.
Needs Pillow and NumPy (pip)."""

import argparse
import struct
import subprocess
import tempfile
from pathlib import Path

import numpy
from PIL import Image


def prefixes(path):
    """Level, bytes up to its end, and its splats."""
    head = Path(path).read_bytes()
    deepest, first = head[104], head[106]
    units, head_bytes = struct.unpack_from("<II", head, 108)
    end = 512 + 24 * units + head_bytes
    ends = {level: end for level in range(first + 1)}
    for n in range(units):
        key, size = struct.unpack_from("<QI", head, 512 + 24 * n)
        end += size
        ends[(key.bit_length() - 1) // 3 + 1] = end
    return [(level, ends[level], struct.unpack_from("<Q", head, 128 + 16 * level)[0]) for level in range(first, deepest + 1)]


def render(program, path, out, size, options):
    options = ["--size", size, "--supersample", "1", "--quiet", *options]
    subprocess.run([program, "render", path, "-o", str(out), *options], check=True)
    return numpy.asarray(Image.open(out).convert("RGB")).astype(float)


def drawn(program, path, level, size, folder):
    return render(program, path, Path(folder) / f"{level}.png", size, ["--splats", "--level", str(level)])


VIEWS = [(-45, 35), (-90, 90), (0, 0), (10, 2), (45, 1), (77, -33), (130, 4), (200, 5), (250, 0.5), (300, 12), (330, -2), (90, 60)]


def shrunk(mask):
    """Pixels whose eight neighbours are in the mask as they are."""
    mask = numpy.pad(mask, 1)
    for axis in (0, 1):
        mask = mask & numpy.roll(mask, 1, axis) & numpy.roll(mask, -1, axis)
    return mask[1:-1, 1:-1]


def holes(program, path, size):
    print("| view | pixels | holes | of 1,000,000 | beyond |\n|---|---|---|---|---|")
    total = numpy.zeros(3, int)
    with tempfile.TemporaryDirectory() as folder:
        for azimuth, elevation in VIEWS:
            view = ["--view", f"{azimuth},{elevation}", "--lod", "0"]
            rays, splats = [
                (render(program, path, Path(folder) / "view.png", size, view + more) != 255).any(axis=2)
                for more in ([], ["--splats"])
            ]
            counts = numpy.array([rays.sum(), (shrunk(rays) & ~splats).sum(), (splats & shrunk(~rays)).sum()])
            total += counts
            pixels, empty, beyond = counts
            print(f"| {azimuth}, {elevation} | {pixels:,} | {empty} | {empty / pixels * 1e6:.0f} | {beyond} |", flush=True)
    print(f"| all | {total[0]:,} | {total[1]} | {total[1] / total[0] * 1e6:.0f} | {total[2]} |")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    parser.add_argument("file")
    parser.add_argument("--size")
    parser.add_argument("--holes", action="store_true")
    args = parser.parse_args()
    if args.holes:
        return holes(args.program, args.file, args.size or "640x480")
    args.size = args.size or "800x800"
    rows = prefixes(args.file)
    weights = numpy.array([0.299, 0.587, 0.114])
    with tempfile.TemporaryDirectory() as folder:
        pictures = [drawn(args.program, args.file, level, args.size, folder) for level, _, _ in rows]
    whole = pictures[-1]
    print("| level | bytes so far | splats | PSNR, dB | silhouette pixels off, % |")
    print("|---|---|---|---|---|")
    for (level, end, splats), picture in zip(rows, pictures):
        error = ((picture - whole) @ weights) ** 2
        psnr = f"{10 * numpy.log10(255**2 / error.mean()):.1f}" if error.any() else "–"
        seen = [(p != 255).any(axis=2) for p in (picture, whole)]
        print(f"| {level} | {end:,} | {splats:,} | {psnr} | {(seen[0] != seen[1]).mean() * 100:.2f} |")


main()
