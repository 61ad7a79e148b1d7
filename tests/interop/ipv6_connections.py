#!/usr/bin/env python3
"""Takes a server's connections from very many addresses of one IPv6 /56 network, while a client of another network asks slowly.

    ipv6_connections.py PORT --seconds 6 --held 100

It runs in a network namespace of its own, in which all of 2001:db8::/32 is local. Each connection of the network comes from another
address. Beyond the number that is held the oldest is closed and a new one opened. The other client sends its request half a second after
it has connected: more connections than the server takes have come meanwhile, so that its own is the idlest of all.

Prints what was opened, and how the other client fared, as one line of JSON.
"""

import argparse
import collections
import json
import socket
import threading
import time

SERVER = "2001:db8:0:1ff::1"
# Linux's, which this module does not name: an address that no interface has.
IPV6_FREEBIND = 78


def connect(source, port):
    connection = socket.socket(socket.AF_INET6)
    connection.setsockopt(socket.IPPROTO_IPV6, IPV6_FREEBIND, 1)
    connection.settimeout(10)
    connection.bind((source, 0))
    connection.connect((SERVER, port))
    return connection


def hold(port, most, until, counts):
    held = collections.deque()
    while time.monotonic() < until:
        number = counts["opened"]
        try:
            held.append(connect(f"2001:db8:0:{number % 256:x}::{number // 256 + 1:x}", port))
            counts["opened"] += 1
        except OSError:
            pass
        if len(held) > most:
            held.popleft().close()
            time.sleep(0.005)


def ask(port):
    """The seconds that it took, or nothing where there was no answer."""
    begun = time.monotonic()
    try:
        with connect("2001:db8:0:100::1", port) as connection:
            time.sleep(0.5)
            connection.sendall(b"GET /healthz HTTP/1.1\r\nHost: server\r\nConnection: close\r\n\r\n")
            if connection.recv(64).startswith(b"HTTP/1.1 200"):
                return time.monotonic() - begun - 0.5
    except OSError:
        pass
    return None


def main():
    parser = argparse.ArgumentParser(description="many connections from one IPv6 network")
    parser.add_argument("port", type=int)
    parser.add_argument("--seconds", type=float, default=6.0)
    parser.add_argument("--held", type=int, default=100)
    options = parser.parse_args()
    counts = {"opened": 0}
    until = time.monotonic() + options.seconds
    holding = threading.Thread(target=hold, args=(options.port, options.held, until, counts))
    holding.start()
    time.sleep(options.seconds / 3)
    answers = []
    while time.monotonic() < until - 1:
        answers.append(ask(options.port))
    holding.join()
    print(json.dumps({**counts, "asked": len(answers), "unanswered": answers.count(None), "longest": max(filter(None, answers), default=None)}))


if __name__ == "__main__":
    main()
