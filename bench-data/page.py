#!/usr/bin/env python3
"""Opens a page that `brickfield splats -o part.html` wrote in a headless Chromium, and compares its picture with that of
`brickfield render --splats`.

    page.py PAGE.html PICTURE.png [--save SEEN.png] [--chromium PROGRAM]

PICTURE.png is of the same part, `--view iso`, any size. Fails if the page writes to the console, asks for anything, or if fewer
than 99 of 100 pixels are within 24 of 255 of the picture's. Needs Pillow (pip) and chromium (Debian)."""

import argparse
import base64
import io
import json
import os
import subprocess
import sys
import tempfile
import time

FLAGS = [
    "--headless", "--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
    "--ignore-gpu-blocklist", "--disable-extensions", "--no-first-run", "--remote-debugging-pipe",
]
SECONDS_MAX = 240


class Browser:
    """A browser that is told what to do through a pipe."""

    def __init__(self, program, profile):
        (self.theirs_in, ours_out), (ours_in, self.theirs_out) = os.pipe(), os.pipe()
        self.out, self.inp = os.fdopen(ours_out, "wb"), os.fdopen(ours_in, "rb")

        def as_three_and_four():
            first, second = os.dup(self.theirs_in), os.dup(self.theirs_out)
            os.dup2(first, 3)
            os.dup2(second, 4)

        command = [program, *FLAGS, "--user-data-dir=" + profile, "about:blank"]
        fds = {3, 4, self.theirs_in, self.theirs_out}
        self.process = subprocess.Popen(command, preexec_fn=as_three_and_four, pass_fds=fds, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        os.close(self.theirs_in)
        os.close(self.theirs_out)
        self.number, self.session, self.events, self.rest = 0, None, [], b""

    def message(self):
        while b"\0" not in self.rest:
            self.rest += os.read(self.inp.fileno(), 1 << 20)
        text, self.rest = self.rest.split(b"\0", 1)
        return json.loads(text)

    def call(self, method, **params):
        self.number += 1
        call = {"id": self.number, "method": method, "params": params}
        if self.session:
            call["sessionId"] = self.session
        self.out.write(json.dumps(call).encode() + b"\0")
        self.out.flush()
        while True:
            message = self.message()
            if message.get("id") == self.number:
                if "error" in message:
                    sys.exit(f"{method}: {message['error']}")
                return message["result"]
            self.events.append(message)

    def value(self, text):
        result = self.call("Runtime.evaluate", expression=text, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in result:
            sys.exit(f"{text}: {result['exceptionDetails']}")
        return result["result"].get("value")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("page")
    parser.add_argument("picture")
    parser.add_argument("--save")
    parser.add_argument("--chromium", default="chromium")
    args = parser.parse_args()
    from PIL import Image

    expected = Image.open(args.picture).convert("RGB")
    width, height = expected.size
    with tempfile.TemporaryDirectory() as profile:
        browser = Browser(args.chromium, profile)
        try:
            check(browser, args, expected, width, height, Image)
        finally:
            browser.process.terminate()
            browser.process.wait()


def check(browser, args, expected, width, height, Image):
    target = browser.call("Target.createTarget", url="about:blank")["targetId"]
    browser.session = browser.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
    for domain in ["Runtime", "Log", "Network", "Page"]:
        browser.call(domain + ".enable")
    address = "file://" + os.path.abspath(args.page)
    began = time.monotonic()
    browser.call("Page.navigate", url=address)
    while True:
        state = browser.value("window.brickfield ? JSON.stringify(brickfield.state) : ''")
        state = json.loads(state) if state else {}
        if state.get("done") or state.get("error"):
            break
        if time.monotonic() - began > SECONDS_MAX:
            sys.exit("the page is not done: " + str(state))
        time.sleep(0.1)
    if state["error"]:
        sys.exit("the page says: " + state["error"])
    seconds = time.monotonic() - began
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
    events = [e for e in browser.events if e.get("method") in ("Runtime.consoleAPICalled", "Log.entryAdded", "Runtime.exceptionThrown")]
    asked = [e["params"]["request"]["url"][:80] for e in browser.events if e.get("method") == "Network.requestWillBeSent"]
    asked = [url for url in asked if url != address and not url.startswith(("data:", "blob:"))]
    report = {
        "splats": state["count"], "decoding_s": round(state["milliseconds"] / 1000, 2), "done_s": round(seconds, 2),
        "frame_s": round(milliseconds / 1000, 2), "pixels_drawn": drawn, "within_24": round(near, 5),
        "within_2": round(sum(1 for o in off if o <= 2) / len(off), 5), "console": len(events), "requests": len(asked),
    }
    print(json.dumps(report))
    for event in events:
        print(json.dumps(event["params"])[:400], file=sys.stderr)
    if events or asked or near < 0.99 or drawn < len(off) / 50:
        sys.exit(f"the page is not as it should be; it asked for {asked}")


main()
