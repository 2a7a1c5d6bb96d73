"""A Firefox that is told what to do by its Marionette protocol, with what `browser.py` has. It draws with WebGL on a display
alone: `xvfb-run` gives one."""

import json
import os
import socket
import subprocess
import sys
import time

from browser import settled

PREFERENCES = {
    # Drawn by the processor, whatever the machine has.
    "webgl.force-enabled": True, "webgl.disabled": False, "gfx.webrender.software": True,
    # Nothing but the page is asked for.
    "app.update.auto": False, "browser.safebrowsing.malware.enabled": False, "browser.safebrowsing.phishing.enabled": False,
    "browser.safebrowsing.downloads.enabled": False, "datareporting.policy.dataSubmissionEnabled": False,
    "network.captive-portal-service.enabled": False, "network.connectivity-service.enabled": False, "extensions.update.enabled": False,
    "browser.startup.homepage": "about:blank", "browser.shell.checkDefaultBrowser": False, "privacy.reduceTimerPrecision": False,
    # A page of 55 MB in one line is compiled at once.
    "dom.max_script_run_time": 0, "security.fileuri.strict_origin_policy": False,
}
EVALUATE = """
const done = arguments[arguments.length - 1];
try {
  Promise.resolve((0, eval)(arguments[0])).then((value) => done([value]), (error) => done([null, String(error)]));
} catch (error) {
  done([null, String(error)]);
}
"""
# What pages do wrong is told to the browser's own process, what they write stays with theirs.
WRONG = """
const [name, done] = arguments;
done(Services.console.getMessageArray().map(String).filter((text) => text.includes(name)));
"""
WRITTEN = """
const storage = Cc["@mozilla.org/consoleAPI-storage;1"].getService(Ci.nsIConsoleAPIStorage);
const text = (event) => `${event.level}: ${event.arguments.join(" ")}`;
arguments[0](storage.getEvents().filter((event) => typeof event.ID === "number").map(text));
"""


class Firefox:
    """A browser that is told what to do through a socket."""

    def __init__(self, program, profile):
        if not os.environ.get("DISPLAY"):
            sys.exit(f"{program} has no display: run this under xvfb-run")
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            port = free.getsockname()[1]
        with open(os.path.join(profile, "user.js"), "w", encoding="utf-8") as file:
            for name, value in {**PREFERENCES, "marionette.port": port}.items():
                file.write(f"user_pref({json.dumps(name)}, {json.dumps(value)});\n")
        command = [program, "--marionette", "-remote-allow-system-access", "--no-remote", "--profile", profile]
        self.process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        self.number, self.rest, self.address = 0, b"", ""
        for _ in range(600):
            try:
                self.socket = socket.create_connection(("127.0.0.1", port), timeout=300)
                break
            except OSError:
                time.sleep(0.1)
        else:
            sys.exit(f"{program} does not listen")
        self.message()
        self.call("WebDriver:NewSession", capabilities={"alwaysMatch": {}})
        self.call("WebDriver:SetTimeouts", script=240_000, pageLoad=240_000)

    def message(self):
        while b":" not in self.rest:
            self.rest += self.socket.recv(1 << 20)
        length, self.rest = self.rest.split(b":", 1)
        while len(self.rest) < int(length):
            self.rest += self.socket.recv(1 << 20)
        text, self.rest = self.rest[: int(length)], self.rest[int(length) :]
        return json.loads(text)

    def call(self, method, **params):
        self.number += 1
        text = json.dumps([0, self.number, method, params]).encode()
        self.socket.sendall(str(len(text)).encode() + b":" + text)
        _, _, error, result = self.message()
        if error:
            sys.exit(f"{method}: {error['error']}: {error['message']}")
        return result

    def page(self, address):
        """Opens a page that `splats` wrote."""
        self.address = address
        self.call("WebDriver:Navigate", url=address)

    def sized(self, width, height):
        """Gives the page this size."""
        for _ in range(3):
            inner = self.value("[innerWidth, innerHeight]")
            outer = self.call("WebDriver:GetWindowRect")
            self.call("WebDriver:SetWindowRect", width=outer["width"] + width - inner[0], height=outer["height"] + height - inner[1])

    def settled(self, done="state.done"):
        """The state of the page when it has all, refuses its data, or another condition holds."""
        return settled(self, done)

    def said(self):
        """What it wrote to the console, and what it asked for."""
        self.call("Marionette:SetContext", value="chrome")
        name = self.address.split("#")[0]
        console = self.call("WebDriver:ExecuteAsyncScript", script=WRONG, args=[name])["value"]
        self.call("Marionette:SetContext", value="content")
        console += self.call("WebDriver:ExecuteAsyncScript", script=WRITTEN, args=[], sandbox="system")["value"]
        asked = self.value("JSON.stringify(performance.getEntriesByType('resource').map((entry) => entry.name))")
        return [{"params": text} for text in console], [url for url in json.loads(asked) if not url.startswith(("data:", "blob:"))]

    def click(self, x, y):
        """Presses and releases the left button over a pixel of the page."""
        moves = [{"type": "pointerMove", "x": x, "y": y}, {"type": "pointerDown", "button": 0}, {"type": "pointerUp", "button": 0}]
        mouse = {"type": "pointer", "id": "mouse", "parameters": {"pointerType": "mouse"}, "actions": moves}
        self.call("WebDriver:PerformActions", actions=[mouse])

    def value(self, text):
        found = self.call("WebDriver:ExecuteAsyncScript", script=EVALUATE, args=[text])["value"]
        if len(found) > 1:
            sys.exit(f"{text}: {found[1]}")
        return found[0]

    def close(self):
        self.process.terminate()
        self.process.wait()
