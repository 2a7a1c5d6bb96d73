#!/usr/bin/env python3
"""Opens a page that `brickfield splats -o part.html` wrote in a headless browser, and compares its picture with that of
`brickfield render --splats`.

    page.py PAGE.html PICTURE.png [--view AZIMUTH,ELEVATION] [--perspective DEGREES] [--picks POINTS.csv] [--beads PART.gcode]
            [--draw processor|webgl] [--save SEEN.png] [--browser PROGRAM]

PICTURE.png is of the same part, by default `--view iso`, any size. Fails if the page writes to the console, asks for anything,
or if fewer than 99 of 100 pixels are within 24 of 255 of the picture's. `--picks` clicks on a grid of pixels and writes the
places that the page tells, as `brickfield sample` reads them. Fails if a place is not seen where it was clicked. `--beads` reads the
lines that picks tell in the G-code that the part was built from, and fails if one lays no bead there, or if a pick lacks layer,
feature or line. The page draws by the processor, or with `--draw webgl` by what the browser takes for a graphics processor. PAGE may be an address. The browser is chromium, or a program whose name has firefox in it. Needs Pillow (pip), and
chromium or firefox-esr (Debian)."""

import argparse
import base64
import io
import json
import math
import os
import sys
import tempfile
import time

from browser import Browser
from firefox import Firefox

STEP = 40
# How far a splat of the example at depth 3 may be from the bead that it shows.
OFF = 0.1


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("page")
    parser.add_argument("picture")
    parser.add_argument("--view", default="-45,35.264389682754654")
    parser.add_argument("--perspective", type=float, default=0)
    parser.add_argument("--picks")
    parser.add_argument("--beads")
    parser.add_argument("--draw", default="processor", choices=["processor", "webgl"])
    parser.add_argument("--save")
    parser.add_argument("--browser", default="chromium")
    args = parser.parse_args()
    from PIL import Image

    expected = Image.open(args.picture).convert("RGB")
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        kind = Firefox if "firefox" in os.path.basename(args.browser) else Browser
        browser = kind(args.browser, profile)
        try:
            check(browser, args, expected, Image)
        finally:
            browser.close()


def check(browser, args, expected, Image):
    width, height = expected.size
    place = args.page if "://" in args.page else "file://" + os.path.abspath(args.page)
    address = f"{place}?draw={args.draw}#{args.view},{args.perspective}"
    began = time.monotonic()
    browser.page(address)
    state = browser.settled()
    if state["error"]:
        sys.exit("the page says: " + state["error"])
    seconds = time.monotonic() - began
    browser.sized(width, height)
    look = f"brickfield.resize({width}, {height}); brickfield.fit();"
    look = f"(async () => {{ {look} const t = performance.now(); const p = await brickfield.picture(); return JSON.stringify([p, performance.now() - t]) }})()"
    picture, milliseconds = json.loads(browser.value(look))
    seen = Image.open(io.BytesIO(base64.b64decode(picture.split(",")[1]))).convert("RGB")
    if args.save:
        seen.save(args.save)
    pixels = [[tuple(bytes_[n : n + 3]) for n in range(0, len(bytes_), 3)] for bytes_ in (seen.tobytes(), expected.tobytes())]
    off = [max(abs(a - b) for a, b in zip(p, q)) for p, q in zip(*pixels)]
    drawn = sum(1 for p in pixels[0] if p != (255, 255, 255))
    near = sum(1 for o in off if o <= 24) / len(off)
    _, before = browser.said()
    picks, found = picked(browser, args.picks, seen) if args.picks or args.beads else ({}, [])
    beads = traced(found, args.beads) if args.beads else {}
    console, asked = browser.said()
    # Of a folder its own files, of which that of beads is asked for by the first pick.
    own = [place, place + "?draw=" + args.draw] + ([place.rsplit("/", 1)[0] + "/" + name for name in ("part.bsp", "part.picks")] if "://" in args.page else [])
    late = [url for url in before if url.endswith(".picks")]
    asked = [url for url in asked if url not in own] + late
    report = {
        "drawer": state["drawer"],
        "splats": state["count"], "decoding_s": round(state["milliseconds"] / 1000, 2), "done_s": round(seconds, 2),
        "frame_s": round(milliseconds / 1000, 2), "pixels_drawn": drawn, "within_24": round(near, 5),
        "within_2": round(sum(1 for o in off if o <= 2) / len(off), 5), "console": len(console), "requests": len(asked), **picks, **beads,
    }
    print(json.dumps(report))
    for event in console:
        print(json.dumps(event["params"])[:400], file=sys.stderr)
    if console or asked or near < 0.99 or drawn < len(off) / 50:
        sys.exit(f"the page is not as it should be; it asked for {asked}")
    if picks and (picks["picks_seen"] < 0.98 * picks["picks"] or picks["picks_off_px"] > 1):
        sys.exit("places are not where they were clicked")
    if beads and (beads["beads"] < picks["picks_seen"] or beads["beads_right"] < beads["beads"] or beads["beads_without_text"]):
        sys.exit("picks tell other beads than the program lays there")


def picked(browser, path, seen):
    """Clicks on a grid: how many places were told of those where something is seen, and how far they are from the click."""
    lines, told, there, worst, all_found = [], 0, 0, 0.0, []
    for y in range(STEP // 2, seen.height, STEP):
        for x in range(STEP // 2, seen.width, STEP):
            around = [seen.getpixel((min(max(x + dx, 0), seen.width - 1), min(max(y + dy, 0), seen.height - 1))) for dx in (-2, 0, 2) for dy in (-2, 0, 2)]
            if (255, 255, 255) in around:
                continue
            there += 1
            browser.value("brickfield.state.picked = null")
            browser.click(x, y)
            found = None
            for _ in range(100):
                found = browser.value("JSON.stringify(brickfield.state.picked)")
                found = json.loads(found) if found else None
                if found:
                    break
                time.sleep(0.05)
            if not found:
                continue
            told += 1
            ring = browser.value("(({ left, top }) => [parseFloat(left), parseFloat(top)])(document.querySelector('i').style)")
            worst = max(worst, math.dist(ring, (x, y)))
            lines.append(",".join(repr(c) for c in found["at"]))
            # The bead comes after the place, if there is a table of them.
            for _ in range(40):
                found = json.loads(browser.value("JSON.stringify(brickfield.state.picked)"))
                if "bead" in found:
                    break
                time.sleep(0.05)
            all_found.append({**found, "said": browser.value("document.querySelector('output').textContent")})
    if path:
        with open(path, "w", encoding="utf-8") as file:
            file.write("x,y,z\n" + "\n".join(lines) + "\n")
    return {"picks": there, "picks_seen": told, "picks_off_px": round(worst, 3)}, all_found


def moves(path):
    """Where the moves of a program go that feed, by line: from, to, layer by their height, width by the slicer's comments. Absolute,
    in millimetres."""
    at, width, heights, found = [0.0, 0.0, 0.0], 0.0, [], {}
    with open(path, encoding="utf-8") as file:
        for number, line in enumerate(file, 1):
            if line.startswith(";WIDTH:"):
                width = float(line[7:])
            words = line.split(";")[0].split()
            if not words or words[0] not in ("G0", "G1"):
                continue
            values = {word[0]: float(word[1:]) for word in words[1:]}
            to = [values.get(axis, at[n]) for n, axis in enumerate("XYZ")]
            if "E" in values and to[:2] != at[:2]:
                if to[2] not in heights:
                    heights.append(to[2])
                found[number] = (at, to, heights.index(to[2]) + 1, width)
            at = to
    return found


def traced(picks, path):
    """Of how many picks the line that they tell lays a bead at the place: beside its way by half a width, between its lower and its
    upper side, all with the tolerance of splats."""
    lines, told, right, worst, silent = moves(path), 0, 0, 0.0, 0
    for pick in picks:
        bead = pick.get("bead")
        if not bead:
            continue
        told += 1
        first, last = bead["lines"]
        silent += not (bead["feature"] and f"layer {bead['layer']}, z " in pick["said"] and f"line {first}" in pick["said"])
        start, end, layer, width = lines.get(first, ((0, 0, 0), (0, 0, 0), None, 0))
        x, y, z = pick["at"]
        along = [end[0] - start[0], end[1] - start[1]]
        square = along[0] ** 2 + along[1] ** 2
        share = min(max(((x - start[0]) * along[0] + (y - start[1]) * along[1]) / square, 0), 1) if square else 0
        across = math.hypot(x - start[0] - share * along[0], y - start[1] - share * along[1])
        bottom, top = bead["bottom"], bead["top"]
        off = max(across - width / 2, bottom - z, z - top, abs(top - end[2]))
        worst = max(worst, off)
        right += layer == bead["layer"] and first == last and off < OFF
    return {"beads": told, "beads_right": right, "beads_off": round(worst, 3), "beads_without_text": silent}


main()
