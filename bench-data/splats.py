#!/usr/bin/env python3
"""What each beginning of a file of splats shows: bytes, splats, and how near its picture is to that of the whole file.

    splats.py BRICKFIELD PART.bsp [--size 800x800]

Draws every level with `render --splats` and compares: the ratio of signal to noise of the luminance (PSNR), and which pixels
are background in one picture only. Needs Pillow and NumPy (pip)."""

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


def drawn(program, path, level, size, folder):
    out = Path(folder) / f"{level}.png"
    options = ["--splats", "--level", str(level), "--size", size, "--supersample", "1", "--quiet"]
    subprocess.run([program, "render", path, "-o", str(out), *options], check=True)
    return numpy.asarray(Image.open(out).convert("RGB")).astype(float)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    parser.add_argument("file")
    parser.add_argument("--size", default="800x800")
    args = parser.parse_args()
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
