#!/usr/bin/env python3
"""How soon a page of a folder shows a part over a slow line: `brickfield splats PART.brf -o FOLDER/`, a paced server, a
headless Chromium.

    stream.py FOLDER [--rate 10] [--delay 0.03] [--views 12] [--size 800x600] [--no-ranges] [--chromium PROGRAM]
    stream.py FOLDER --finished BRICKFIELD [--views 4]
    stream.py FOLDER --faults
    stream.py FOLDER --zoom BRICKFIELD

For each view a browser without a cache asks for the page. The page tells when a picture of each level could be read, counted
from its request, and when its splats were decoded. When all is there, each level is drawn again and compared with the last: the ratio of signal to noise of the
luminance (PSNR). With `--finished` pictures are kept as they are seen, also while what is in view is refined, and compared with the one that the
program draws of the whole file. `--zoom` looks close at one place, and fails unless the page gets there what the program draws,
by a part of the file, and forgets what is out of view. `--faults` stops and goes on, cuts the line, damages bytes, exchanges the file, and serves without ranges, the
table of beads as well; it fails unless the page does what it should. Needs Pillow and NumPy (pip) and chromium (Debian)."""

import argparse
import base64
import contextlib
import io
import json
import os
import shutil
import subprocess
import sys
import tempfile
import threading
import time
import zlib

import serve
from browser import Browser

GOALS = [20, 30]


def views(count):
    """All around, from below and above."""
    return [(360 * n / count - 180, (-20, 15, 35, 60)[n % 4]) for n in range(count)]


def choose(browser, level):
    browser.value(f"document.getElementById('level').value = {level}; document.getElementById('level').dispatchEvent(new Event('change'))")


def picture(browser, level):
    """The picture of a level as luminance."""
    count = browser.value("brickfield.state.log.length")
    choose(browser, level)
    browser.settled(f"state.log.length > {count} && state.done")
    return luminance(seen_file(browser.value("brickfield.picture()")))


def decibels(picture, whole):
    import numpy

    error = ((picture - whole) ** 2).mean()
    return 99.0 if error == 0 else float(10 * numpy.log10(255**2 / error))


def served(args, rate, delay):
    """The address of a server of the folder."""
    server = serve.started(args.folder, 0, delay, rate, not args.no_ranges)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    return f"http://127.0.0.1:{server.server_address[1]}/"


@contextlib.contextmanager
def visited(args, address):
    """A browser without a cache that opens a page."""
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        browser = Browser(args.chromium, profile)
        try:
            browser.visit(address, *map(int, args.size.split("x")))
            yield browser
        finally:
            browser.close()


def look(args, address, view):
    """One cold visit: what was seen when."""
    with visited(args, f"{address}#{view[0]},{view[1]}") as browser:
        state = browser.settled()
        if state["error"]:
            sys.exit("the page says: " + state["error"])
        log = list({seen["level"]: seen for seen in reversed(state["log"]) if seen["whole"] >= seen["level"]}.values())[::-1]
        pictures = [picture(browser, seen["level"]) for seen in log]
        console, _ = browser.said()
        if console:
            sys.exit(f"the page wrote to the console: {console}")
        return [(seen, decibels(pixels, pictures[-1])) for seen, pixels in zip(log, pictures)]


def drawn(args, program, view, options=()):
    """The picture of the whole file that the program draws, as luminance."""
    with tempfile.TemporaryDirectory() as folder:
        out = os.path.join(folder, "view.png")
        part = os.path.join(args.folder, "part.bsp")
        subprocess.run([program, "render", part, "--splats", f"--view={view[0]},{view[1]}", "--size", args.size, "--supersample", "1", "--quiet", *options, "-o", out], check=True)
        return luminance(out)


def luminance(file):
    import numpy
    from PIL import Image

    return numpy.asarray(Image.open(file).convert("RGB")).astype(float) @ numpy.array([0.299, 0.587, 0.114])


def seen_file(address):
    """The file of a picture that a page gave as an address."""
    return io.BytesIO(base64.b64decode(address.split(",")[1]))


def finished(args):
    """What is seen when, of the picture that the program draws of all."""
    address = served(args, args.rate, args.delay)
    for view in views(args.views):
        whole = drawn(args, args.finished, view)
        with visited(args, f"{address}?keep&draw=processor#{view[0]},{view[1]}") as browser:
            state = browser.settled("state.refined")
        seen = [[round(s["seen"]), s["received"], s["count"], round(decibels(luminance(seen_file(s["picture"])), whole), 1)] for s in state["log"]]
        print(json.dumps({"view": view, "seen": seen}), flush=True)


def zoom(args):
    """Looks close at one place, then at another."""
    width, height = map(int, args.size.split("x"))
    address, size = served(args, 0.0, 0.0), os.path.getsize(os.path.join(args.folder, "part.bsp"))
    for drawer in ["processor", "webgl"]:
        with visited(args, f"{address}?draw={drawer}#-45,35") as browser:
            state = browser.settled("state.refined")
            require(f"{drawer}: the part from afar", state["drawer"] == drawer and state["received"] < size, state)
            for n, (x, y) in enumerate([(0.5, 0.5), (0.4, 0.55), (0.6, 0.45)]):
                browser.value(f"brickfield.fit(); brickfield.pick({x * width}, {y * height})")
                browser.settled("state.picked && state.picked.place")
                browser.value("{ const { view, state } = brickfield; view.centre = state.picked.place; view.height /= 12; state.picked = null; brickfield.draw() }")
                time.sleep(1)
                state = browser.settled("state.refined")
                centre = json.loads(browser.value("JSON.stringify(brickfield.at(brickfield.view.centre))"))
                options = ["--focus=" + ",".join(map(repr, [*centre, browser.value("brickfield.view.height")]))]
                db = decibels(luminance(seen_file(browser.value("brickfield.picture()"))), drawn(args, args.zoom, (-45, 35), options))
                require(f"{drawer}: close at place {n + 1}: {state['count']} splats, {state['received']} bytes, {db:.1f} dB", db > 30 and state["count"] < 8e6, state)
            count = state["count"]
            choose(browser, 2)
            state = browser.settled(f"state.count < {count} && state.level === 2")
            browser.value("brickfield.view.azimuth += 20; brickfield.draw()")
            time.sleep(2)
            later = browser.settled("true")
            require(f"{drawer}: a coarser level stays", later["count"] == state["count"] and later["level"] == 2, later)
            choose(browser, 4)
            state = browser.settled("state.refined && state.level === 4")
            require(f"{drawer}: and a finer one refines again", state["count"] > later["count"], state)
            require(f"{drawer}: the console is empty", browser.said()[0] == [], browser.said())


def without_ranges(args):
    """A server that knows no ranges is asked for the file once, whatever is looked at."""
    with Visit(args, args.folder, ranges=False) as (browser, server):
        state = browser.settled()
        browser.value("brickfield.view.height /= 12; brickfield.draw()")
        time.sleep(2)
        later = browser.settled("true")
        require("without ranges nothing is read twice", later["received"] == state["received"] and serve.Handler.requests == 2, later)


def measure(args):
    address = served(args, args.rate, args.delay)
    rows, reached, there = [], {goal: [] for goal in GOALS}, {goal: [] for goal in GOALS}
    for view in views(args.views):
        seen = look(args, address, view)
        rows.append(seen)
        for goal in GOALS:
            first = next(s for s, db in seen if db >= goal)
            reached[goal].append(first["seen"] / 1000)
            there[goal].append(first["decoded"] / 1000)
        print(json.dumps({"view": view, "levels": [[s["level"], s["received"], s["count"], round(s["decoded"]), round(s["seen"]), round(db, 1)] for s, db in seen]}), flush=True)
    print("| level | bytes | splats | decoded after, s | seen after, s: median, worst | PSNR, dB: least, median |")
    print("|---|---|---|---|---|---|")
    middle = lambda numbers: sorted(numbers)[len(numbers) // 2]
    # Where drawing is slow a level may be gone before it was seen.
    for level in sorted({s["level"] for row in rows for s, _ in row}):
        of = [(s, db) for row in rows for s, db in row if s["level"] == level]
        seen, decoded, db = [s["seen"] / 1000 for s, _ in of], [s["decoded"] / 1000 for s, _ in of], [db for _, db in of]
        s = of[0][0]
        print(f"| {level} | {s['received']:,} | {s['count']:,} | {middle(decoded):.2f} | {middle(seen):.2f}, {max(seen):.2f} | {min(db):.1f}, {middle(db):.1f} |")
    for goal in GOALS:
        print(f"{goal} dB: decoded after {middle(there[goal]):.2f} s (median), {max(there[goal]):.2f} s (worst), seen after {middle(reached[goal]):.2f} s, {max(reached[goal]):.2f} s")


class Visit:
    """A page that is there, for one fault."""

    def __init__(self, args, folder, rate=0.0, ranges=True):
        self.server = serve.started(folder, 0, 0.0, rate, ranges)
        serve.Handler.requests = 0
        threading.Thread(target=self.server.serve_forever, daemon=True).start()
        self.profile = tempfile.TemporaryDirectory()
        self.browser = Browser(args.chromium, self.profile.name)
        self.browser.visit(f"http://127.0.0.1:{self.server.server_address[1]}/", 200, 150)

    def __enter__(self):
        return self.browser, self.server

    def __exit__(self, *_):
        self.browser.close()
        self.server.shutdown()
        self.server.server_close()
        self.profile.cleanup()


def require(what, holds, state):
    print(("ok     " if holds else "FAILED ") + what, flush=True)
    if not holds:
        sys.exit(json.dumps(state)[:600])


def text(browser):
    return browser.value("document.querySelector('output').textContent")


def faults(args):
    size = os.path.getsize(os.path.join(args.folder, "part.bsp"))
    # So slow that there is time to do something.
    slow = size * 8 / 1e6 / 8
    click = "document.getElementById('flow').click()"
    with Visit(args, args.folder) as (browser, _):
        whole = browser.settled()
        require("all of it is shown", whole["done"] and not whole["error"], whole)
        require("the console is empty", browser.said()[0] == [], browser.said())
    with Visit(args, args.folder, ranges=False) as (browser, server):
        state = browser.settled()
        require("a server without ranges", state["count"] == whole["count"], state)
        require("in one answer, beside the page", serve.Handler.requests == 2, serve.Handler.requests)
    with Visit(args, args.folder, rate=slow) as (browser, server):
        browser.settled("state.received > 40000 && state.count > 0")
        browser.value(click)
        state = browser.settled("state.stopped && document.getElementById('flow').textContent === 'Go on'")
        time.sleep(1)
        later = browser.settled("true")
        require("a stop", not later["done"] and later["received"] < size * 0.9 and later["received"] - state["received"] < 70000, later)
        server.rate = 0
        browser.value(click)
        state = browser.settled()
        require("goes on to the same picture", state["count"] == whole["count"], state)
        require("without all bytes again", state["received"] < size + 200_000, state)
    with Visit(args, args.folder, rate=slow) as (browser, server):
        browser.settled("state.received > 40000 && state.count > 0")
        server.cut = True
        state = browser.settled("document.getElementById('flow').textContent === 'Go on'")
        require("a line that is cut", "does not answer" in text(browser) and state["count"] > 0, text(browser))
        server.cut, server.rate = False, 0
        browser.value(click)
        state = browser.settled()
        require("and is there again", state["count"] == whole["count"], state)
    for what, change, said in [
        ("a damaged unit", lambda bytes_: bytes_[:-5] + bytes([bytes_[-5] ^ 4]) + bytes_[-4:], "damaged"),
        ("a damaged header", lambda bytes_: bytes_[:60] + bytes([bytes_[60] ^ 4]) + bytes_[61:], "damaged"),
        ("a file that is cut short", lambda bytes_: bytes_[: len(bytes_) * 2 // 3], "ends within"),
        ("another kind of file", lambda bytes_: b"<html>" * 1000, "does not begin as a file of splats"),
    ]:
        with tempfile.TemporaryDirectory() as copy:
            shutil.copy(os.path.join(args.folder, "index.html"), copy)
            with open(os.path.join(args.folder, "part.bsp"), "rb") as file, open(os.path.join(copy, "part.bsp"), "wb") as out:
                out.write(change(file.read()))
            with Visit(args, copy) as (browser, _):
                state = browser.settled()
                require(what, said in (state["error"] or "") and state["error"] in text(browser), state)
    with tempfile.TemporaryDirectory() as copy:
        for name in ["index.html", "part.bsp"]:
            shutil.copy(os.path.join(args.folder, name), copy)
        with Visit(args, copy, rate=slow) as (browser, server):
            browser.settled("state.received > 40000 && state.count > 0")
            browser.value(click)
            browser.settled("document.getElementById('flow').textContent === 'Go on'")
            os.utime(os.path.join(copy, "part.bsp"), (1, 1))
            browser.value(click)
            state = browser.settled()
            require("a file that was exchanged", "has changed on the server" in (state["error"] or ""), state)
    if os.path.exists(os.path.join(args.folder, "part.picks")):
        beads(args)


def pick(browser, expected):
    """Asks for the middle of the picture until the page says so."""
    browser.value("brickfield.fit(); brickfield.pick(100, 75)")
    browser.settled(f"state.picked && 'bead' in state.picked && {expected}")
    return browser.value("JSON.stringify(brickfield.state.picked)")


def beads(args):
    """The table of beads beside the splats: asked for by the first pick alone, and no harm if it is not what it should be."""
    for ranges in [True, False]:
        with Visit(args, args.folder, ranges=ranges) as (browser, server):
            browser.settled()
            before = serve.Handler.requests
            found = json.loads(pick(browser, "state.picked.bead"))
            asked = serve.Handler.requests - before
            pick(browser, "state.picked.bead")
            require(f"a bead, with{'' if ranges else 'out'} ranges", found["bead"]["layer"] > 0 and 1 <= asked <= 4, [found, asked])
            require("its table is read once", serve.Handler.requests - before == asked, serve.Handler.requests)
            require("the console is empty", browser.said()[0] == [], browser.said())
    damaged = lambda bytes_: bytes_[:-5] + bytes([bytes_[-5] ^ 4]) + bytes_[-4:]
    other = lambda bytes_: sealed(bytes_[:88] + bytes([bytes_[88] ^ 4]) + bytes_[89:])
    for what, change, said in [
        ("a damaged block of beads", damaged, "it is damaged"),
        ("a damaged table of beads", lambda bytes_: bytes_[:20] + b"x" + bytes_[21:], "it is damaged"),
        ("the beads of another part", other, "it belongs to another part"),
        ("a table that is cut short", lambda bytes_: bytes_[:200], "it is no table of beads"),
        ("another file", lambda bytes_: b"<html>" * 100, "it is no table of beads"),
    ]:
        with tempfile.TemporaryDirectory() as copy:
            for name in ["index.html", "part.bsp"]:
                shutil.copy(os.path.join(args.folder, name), copy)
            with open(os.path.join(args.folder, "part.picks"), "rb") as file, open(os.path.join(copy, "part.picks"), "wb") as out:
                out.write(change(file.read()))
            with Visit(args, copy) as (browser, _):
                browser.settled()
                pick(browser, "!state.picked.bead")
                state = browser.settled()
                require(what, "no bead" in text(browser) and said in text(browser) and not state["error"], text(browser))
                require("the place is told, and the console is empty", "x " in text(browser) and browser.said()[0] == [], browser.said())


def sealed(table):
    """A table whose header has a checksum that fits."""
    return table[:108] + zlib.crc32(table[:108]).to_bytes(4, "little") + table[112:]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder")
    parser.add_argument("--rate", type=float, default=10)
    parser.add_argument("--delay", type=float, default=0.03)
    parser.add_argument("--views", type=int, default=12)
    parser.add_argument("--size", default="800x600")
    parser.add_argument("--no-ranges", action="store_true")
    parser.add_argument("--finished", metavar="BRICKFIELD")
    parser.add_argument("--zoom", metavar="BRICKFIELD")
    parser.add_argument("--faults", action="store_true")
    parser.add_argument("--chromium", default="chromium")
    args = parser.parse_args()
    if args.finished:
        finished(args)
    elif args.zoom:
        zoom(args)
        without_ranges(args)
    elif args.faults:
        faults(args)
    else:
        measure(args)


main()
