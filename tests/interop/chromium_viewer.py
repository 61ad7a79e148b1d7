#!/usr/bin/env python3
"""An independent viewer: headless Chromium on chromium_viewer.html. Counts the `paper` frames of a room.

    python3 chromium_viewer.py LINK [--frames 60] [--timeout 30]

Prints what the page counted as one line of JSON and exits with 0 if all frames came. An optional check: without a Chromium it
prints `skipped: why` and exits with 0, whatever CI says. Nothing but Python's own library is needed.
"""

import argparse
import http.server
import json
import os
import queue
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time

import wire

PAGE = os.path.join(os.path.dirname(os.path.abspath(__file__)), "chromium_viewer.html")
# A browser that dies is started again so many times.
RESTARTS = 2
NAMES = ["chromium", "chromium-browser", "google-chrome-stable", "google-chrome"]
FLAGS = [
    "--headless=new",
    "--disable-gpu",
    "--disable-dev-shm-usage",
    "--no-first-run",
    # The page comes from here and calls the room's server, which need not serve pages.
    "--disable-web-security",
    "--allow-loopback-in-peer-connection",
    "--disable-features=WebRtcHideLocalIpsWithMdns",
]


def serve(job, results):
    """Serves the page and its job, and takes its result; gives the server."""

    class Handler(http.server.BaseHTTPRequestHandler):
        def answer(self, kind, body):
            self.send_response(200)
            self.send_header("Content-Type", kind)
            self.end_headers()
            self.wfile.write(body)

        def do_GET(self):
            if self.path == "/job":
                self.answer("application/json", json.dumps(job).encode())
            else:
                with open(PAGE, "rb") as page:
                    self.answer("text/html", page.read())

        def do_POST(self):
            results.put(json.loads(self.rfile.read(int(self.headers["Content-Length"]))))
            self.answer("text/plain", b"")

        def log_message(self, *_):
            pass

    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    return server


def browse(chromium, flags, url, results, timeout):
    """The page's result, or why there is none; `browser` is then how the browser itself ended, if it did."""
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile, tempfile.TemporaryFile() as log:
        # A group of its own: Chromium is a family of processes.
        browser = subprocess.Popen([chromium, *flags, f"--user-data-dir={profile}", "--remote-debugging-port=0", url],
                                   stdout=log, stderr=log, start_new_session=True)
        # Chromium itself may take a while to start.
        until, result = time.monotonic() + timeout + 20, None
        try:
            while result is None:
                ended = browser.poll()
                try:
                    result = results.get(timeout=0.2)
                except queue.Empty:
                    if ended is not None or time.monotonic() > until:
                        log.seek(0)
                        tail = log.read().decode(errors="replace")[-2000:]
                        result = {"failed": "the page told nothing", "browser": ended, "log": tail}
        finally:
            try:
                os.killpg(browser.pid, signal.SIGKILL)
            except ProcessLookupError:
                pass
            browser.wait()
    return result


def main():
    parser = argparse.ArgumentParser(description="a browser as a viewer")
    parser.add_argument("link", help="the room's link for viewers")
    parser.add_argument("--frames", type=int, default=60, help="end after so many")
    parser.add_argument("--timeout", type=float, default=30.0, help="seconds until it gives up")
    options = parser.parse_args()
    link = wire.Link(options.link)
    chromium = next(filter(None, map(shutil.which, NAMES)), None)
    if chromium is None:
        print(f"skipped: there is no Chromium (none of {', '.join(NAMES)} on PATH)")
        return 0
    job = {
        "base": f"{'https' if link.tls else 'http'}://{link.host}{link.base}",
        "room": link.room,
        "token": link.token,
        "secret": None if link.secret is None else list(link.secret),
        "frames": options.frames,
        "timeout": options.timeout,
    }
    results = queue.Queue()
    server = serve(job, results)
    flags = FLAGS + (["--no-sandbox"] if os.geteuid() == 0 else [])
    for attempt in range(1 + RESTARTS):
        result = browse(chromium, flags, f"http://127.0.0.1:{server.server_port}/", results, options.timeout)
        if result.get("browser") is None or attempt == RESTARTS:
            break
        print(f"started again: Chromium ended by itself: {result['browser']}", flush=True)
    print(json.dumps(result))
    return 0 if result.get("frames", 0) >= options.frames and not result.get("failed") else 1


sys.exit(main())
