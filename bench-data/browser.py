"""A headless Chromium that is told what to do through a pipe."""

import json
import os
import subprocess
import sys
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

    def page(self, address):
        """Opens a page that `splats` wrote, and hears all that it says and asks for."""
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self.session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ["Runtime", "Log", "Network", "Page"]:
            self.call(domain + ".enable")
        self.events = []
        self.call("Page.navigate", url=address)

    def sized(self, width, height):
        """Gives the page this size."""
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)

    def visit(self, address, width, height):
        """Opens a page that has its size from its first line on."""
        self.page("about:blank")
        self.sized(width, height)
        self.call("Page.navigate", url=address)

    def settled(self, done="state.done"):
        """The state of the page when it has all, refuses its data, or another condition holds."""
        return settled(self, done)

    def said(self):
        """What it wrote to the console, and what it asked for."""
        names = ("Runtime.consoleAPICalled", "Log.entryAdded", "Runtime.exceptionThrown")
        console = [e for e in self.events if e.get("method") in names]
        asked = [e["params"]["request"]["url"] for e in self.events if e.get("method") == "Network.requestWillBeSent"]
        return console, [url for url in asked if not url.startswith(("data:", "blob:"))]

    def click(self, x, y):
        """Presses and releases the left button over a pixel of the page."""
        for kind in ["mousePressed", "mouseReleased"]:
            self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)

    def value(self, text):
        result = self.call("Runtime.evaluate", expression=text, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in result:
            sys.exit(f"{text}: {result['exceptionDetails']}")
        return result["result"].get("value")

    def close(self):
        self.process.terminate()
        self.process.wait()


def settled(browser, done):
    """The state of a page in a browser when it has all, refuses its data, or another condition holds."""
    began = time.monotonic()
    while True:
        state = browser.value(f"window.brickfield ? JSON.stringify([brickfield.state, ((state) => {done})(brickfield.state)]) : ''")
        state, is_done = json.loads(state) if state else ({}, False)
        if is_done or state.get("error"):
            return state
        if time.monotonic() - began > SECONDS_MAX:
            sys.exit("the page is not done: " + str(state))
        time.sleep(0.1)
