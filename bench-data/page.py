#!/usr/bin/env python3
"""Opens a page that `brickfield splats -o part.html` wrote in a headless Chromium, and compares its picture with that of
`brickfield render --splats`.

    page.py PAGE.html PICTURE.png [--view AZIMUTH,ELEVATION] [--perspective DEGREES] [--picks POINTS.csv] [--save SEEN.png]
            [--chromium PROGRAM]

PICTURE.png is of the same part, by default `--view iso`, any size. Fails if the page writes to the console, asks for anything,
or if fewer than 99 of 100 pixels are within 24 of 255 of the picture's. `--picks` clicks on a grid of pixels and writes the
places that the page tells, as `brickfield sample` reads them. Fails if a place is not seen where it was clicked. Needs Pillow
(pip) and chromium (Debian)."""

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

STEP = 40


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("page")
    parser.add_argument("picture")
    parser.add_argument("--view", default="-45,35.264389682754654")
    parser.add_argument("--perspective", type=float, default=0)
    parser.add_argument("--picks")
    parser.add_argument("--save")
    parser.add_argument("--chromium", default="chromium")
    args = parser.parse_args()
    from PIL import Image

    expected = Image.open(args.picture).convert("RGB")
    with tempfile.TemporaryDirectory() as profile:
        browser = Browser(args.chromium, profile)
        try:
            check(browser, args, expected, Image)
        finally:
            browser.close()


def check(browser, args, expected, Image):
    width, height = expected.size
    address = f"file://{os.path.abspath(args.page)}#{args.view},{args.perspective}"
    began = time.monotonic()
    browser.page(address)
    state = browser.settled()
    if state["error"]:
        sys.exit("the page says: " + state["error"])
    seconds = time.monotonic() - began
    browser.sized(width, height)
    look = f"brickfield.resize({width}, {height}); brickfield.fit();"
    look += "{ const t = performance.now(); const p = brickfield.picture(); JSON.stringify([p, performance.now() - t]) }"
    picture, milliseconds = json.loads(browser.value(look))
    seen = Image.open(io.BytesIO(base64.b64decode(picture.split(",")[1]))).convert("RGB")
    if args.save:
        seen.save(args.save)
    pixels = [[tuple(bytes_[n : n + 3]) for n in range(0, len(bytes_), 3)] for bytes_ in (seen.tobytes(), expected.tobytes())]
    off = [max(abs(a - b) for a, b in zip(p, q)) for p, q in zip(*pixels)]
    drawn = sum(1 for p in pixels[0] if p != (255, 255, 255))
    near = sum(1 for o in off if o <= 24) / len(off)
    picks = picked(browser, args.picks, seen) if args.picks else {}
    console, asked = browser.said()
    asked = [url for url in asked if url != address.split("#")[0]]
    report = {
        "splats": state["count"], "decoding_s": round(state["milliseconds"] / 1000, 2), "done_s": round(seconds, 2),
        "frame_s": round(milliseconds / 1000, 2), "pixels_drawn": drawn, "within_24": round(near, 5),
        "within_2": round(sum(1 for o in off if o <= 2) / len(off), 5), "console": len(console), "requests": len(asked), **picks,
    }
    print(json.dumps(report))
    for event in console:
        print(json.dumps(event["params"])[:400], file=sys.stderr)
    if console or asked or near < 0.99 or drawn < len(off) / 50:
        sys.exit(f"the page is not as it should be; it asked for {asked}")
    if picks and (picks["picks_seen"] < 0.98 * picks["picks"] or picks["picks_off_px"] > 1):
        sys.exit("places are not where they were clicked")


def picked(browser, path, seen):
    """Clicks on a grid: how many places were told of those where something is seen, and how far they are from the click."""
    lines, told, there, worst = [], 0, 0, 0.0
    for y in range(STEP // 2, seen.height, STEP):
        for x in range(STEP // 2, seen.width, STEP):
            around = [seen.getpixel((min(max(x + dx, 0), seen.width - 1), min(max(y + dy, 0), seen.height - 1))) for dx in (-2, 0, 2) for dy in (-2, 0, 2)]
            if (255, 255, 255) in around:
                continue
            there += 1
            browser.value("brickfield.state.picked = null")
            for kind in ["mousePressed", "mouseReleased"]:
                browser.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)
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
    with open(path, "w", encoding="utf-8") as file:
        file.write("x,y,z\n" + "\n".join(lines) + "\n")
    return {"picks": there, "picks_seen": told, "picks_off_px": round(worst, 3)}


main()
