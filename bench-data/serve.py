#!/usr/bin/env python3
"""Serves a folder by byte ranges, as slowly as a far server, and tells what it was asked for.

    serve.py FOLDER [--port 8765] [--delay SECONDS] [--rate MBIT] [--no-ranges]

A delay is added to each request. All answers together get so many megabits a second. Without ranges every answer is the whole
file. `GET /?count` answers the requests and bytes since it was asked last, as JSON.
"""

import argparse
import http.server
import json
import os
import re
import threading
import time
from email.utils import formatdate

# Bytes that are sent at once, and how long a sleep may be too long.
PIECE = 4096
LATE = 0.005


class Handler(http.server.BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    lock, requests, sent, free = threading.Lock(), 0, 0, 0.0

    def do_GET(self):
        if self.path == "/?count":
            with Handler.lock:
                counted = {"requests": Handler.requests, "bytes": Handler.sent}
                Handler.requests = Handler.sent = 0
            return self.answer(200, json.dumps(counted).encode())
        time.sleep(self.server.delay)
        if self.server.cut:
            self.close_connection = True
            return None
        name = self.path.split("?")[0]
        path = os.path.join(self.server.folder, "index.html" if name == "/" else os.path.basename(name))
        if not os.path.isfile(path):
            return self.answer(404, b"")
        stat = os.stat(path)
        head = {
            "ETag": f'"{stat.st_mtime_ns:x}-{stat.st_size:x}"',
            "Last-Modified": formatdate(stat.st_mtime, usegmt=True),
            "Content-Type": "text/html" if path.endswith(".html") else "application/octet-stream",
        }
        if self.server.ranges:
            head["Accept-Ranges"] = "bytes"
        asked = self.server.ranges and re.fullmatch(r"bytes=(\d+)-(\d+)", self.headers.get("Range", ""))
        first, last = (int(asked[1]), min(int(asked[2]), stat.st_size - 1)) if asked else (0, stat.st_size - 1)
        if first > last:
            return self.answer(416, b"", {"Content-Range": f"bytes */{stat.st_size}"})
        with open(path, "rb") as file:
            file.seek(first)
            body = file.read(last - first + 1)
        with Handler.lock:
            Handler.requests += 1
        if asked:
            head["Content-Range"] = f"bytes {first}-{last}/{stat.st_size}"
        self.answer(206 if asked else 200, body, head)

    def answer(self, status, body, head={}):
        self.send_response(status)
        for name, value in head.items():
            self.send_header(name, value)
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        for at in range(0, len(body), PIECE):
            piece = body[at : at + PIECE]
            self.wait(len(piece))
            if self.server.cut:
                self.close_connection = True
                return
            try:
                self.wfile.write(piece)
            except OSError:
                # Whoever asked has gone.
                self.close_connection = True
                return
            with Handler.lock:
                Handler.sent += len(piece)

    def wait(self, count):
        """Until the line is free, which `count` bytes then take."""
        if not self.server.rate:
            return
        with Handler.lock:
            now = time.monotonic()
            Handler.free = max(Handler.free, now - LATE) + count * 8 / (self.server.rate * 1e6)
            until = Handler.free
        time.sleep(max(0.0, until - now))

    def log_message(self, *_):
        pass


class Server(http.server.ThreadingHTTPServer):
    request_queue_size = 128
    daemon_threads = True


def started(folder, port=0, delay=0.0, rate=0.0, ranges=True):
    """A server, which answers when it is told to."""
    server = Server(("127.0.0.1", port), Handler)
    server.folder, server.delay, server.rate, server.ranges = folder, delay, rate, ranges
    # Whether the line is cut: nothing is sent any more.
    server.cut = False
    return server


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder")
    parser.add_argument("--port", type=int, default=8765)
    parser.add_argument("--delay", type=float, default=0.0)
    parser.add_argument("--rate", type=float, default=0.0)
    parser.add_argument("--no-ranges", action="store_true")
    args = parser.parse_args()
    started(args.folder, args.port, args.delay, args.rate, not args.no_ranges).serve_forever()


if __name__ == "__main__":
    main()
