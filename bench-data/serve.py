#!/usr/bin/env python3
"""Serves a folder by byte ranges, as slowly as a far server, and tells what it was asked for.

    serve.py FOLDER [--port 8765] [--delay SECONDS]

A delay is added to each request. `GET /?count` answers the requests and bytes since it was asked last, as JSON.
"""

import argparse
import http.server
import json
import os
import re
import threading
import time
from email.utils import formatdate


class Handler(http.server.BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    lock, requests, sent = threading.Lock(), 0, 0

    def do_GET(self):
        if self.path == "/?count":
            with Handler.lock:
                counted = {"requests": Handler.requests, "bytes": Handler.sent}
                Handler.requests = Handler.sent = 0
            return self.answer(200, json.dumps(counted).encode())
        time.sleep(self.server.delay)
        path = os.path.join(self.server.folder, os.path.basename(self.path))
        if not os.path.isfile(path):
            return self.answer(404, b"")
        stat = os.stat(path)
        head = {
            "ETag": f'"{stat.st_mtime_ns:x}-{stat.st_size:x}"',
            "Last-Modified": formatdate(stat.st_mtime, usegmt=True),
            "Accept-Ranges": "bytes",
        }
        asked = re.fullmatch(r"bytes=(\d+)-(\d+)", self.headers.get("Range", ""))
        first, last = (int(asked[1]), min(int(asked[2]), stat.st_size - 1)) if asked else (0, stat.st_size - 1)
        if first > last:
            return self.answer(416, b"", {"Content-Range": f"bytes */{stat.st_size}"})
        with open(path, "rb") as file:
            file.seek(first)
            body = file.read(last - first + 1)
        with Handler.lock:
            Handler.requests += 1
            Handler.sent += len(body)
        if asked:
            head["Content-Range"] = f"bytes {first}-{last}/{stat.st_size}"
        self.answer(206 if asked else 200, body, head)

    def answer(self, status, body, head={}):
        self.send_response(status)
        for name, value in head.items():
            self.send_header(name, value)
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, *_):
        pass


class Server(http.server.ThreadingHTTPServer):
    request_queue_size = 128
    daemon_threads = True


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder")
    parser.add_argument("--port", type=int, default=8765)
    parser.add_argument("--delay", type=float, default=0.0)
    args = parser.parse_args()
    server = Server(("127.0.0.1", args.port), Handler)
    server.folder, server.delay = args.folder, args.delay
    server.serve_forever()


if __name__ == "__main__":
    main()
