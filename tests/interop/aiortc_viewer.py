#!/usr/bin/env python3
"""An independent viewer: aiortc and docs/protocol.md. Joins a room and reads its `paper` frames.

    $MON3TR_PYTHON aiortc_viewer.py LINK [--frames 90] [--timeout 20] [--keep 1,30,90] [--address 127.0.0.1]

Prints what came as one line of JSON. Exits with 0 if as many frames came as were asked for and none was refused.
"""

import argparse
import asyncio
import json
import secrets
import sys

import wire
from aiortc import RTCSessionDescription
from aiortc_peer import bind_to, new_peer, open_channels

FEEDBACK_EVERY_S = 0.15


def percentile(values, part):
    """The value below which that part of the values lies."""
    ordered = sorted(values)
    return ordered[min(len(ordered) - 1, int(part * len(ordered)))] if ordered else None


class Call:
    """The frames received, and the clocks' offset."""

    def __init__(self, options):
        self.options, self.link = options, wire.Link(options.link)
        self.session, self.channel, self.done = secrets.randbits(32), None, asyncio.Event()
        self.newest, self.received, self.frames, self.bye = 0, 0, 0, False
        self.leaving = False
        # The session of the frames, which is another one where they are forwarded; and what opens them.
        self.motion, self.sealed, self.opener, self.avatar = self.session, False, None, None
        self.exchange = wire.Exchange()
        self.counts, self.kept, self.arrivals, self.bytes = {}, [], [], 0
        # (round trip, their clock less ours) of the pong that was quickest: it is wrong by half its round trip at most.
        self.clock = None

    def count(self, what):
        self.counts[what] = self.counts.get(what, 0) + 1

    def heard(self, message):
        arrived = wire.now_us()
        try:
            kind = message[0] if isinstance(message, bytes) and message else None
            if self.sealed and kind == wire.SEAL:
                self.opener = self.opener or self.seal(message)
                return
            if self.sealed and kind in (wire.SEALED, wire.PAPER, wire.STATE):
                # Whoever forwards has nothing of the sender's to say but what is sealed.
                message = self.opener and self.opener.message(message)
                if not message:
                    self.count("not_opened")
                    return
                self.count("opened")
                kind = message[0]
            if kind == wire.PAPER:
                self.frame(arrived, message)
            elif kind == wire.STATE:
                flags, _ = wire.unpack(wire.STATE_MESSAGE, message, self.motion)
                if flags & 3:
                    raise wire.Refused("state")
                self.count("states")
            elif kind == wire.PONG:
                sent, there, left = wire.unpack(wire.PONG_MESSAGE, message, self.session)
                round_trip, offset = (arrived - sent) - (left - there), ((there - sent) + (left - arrived)) / 2
                if self.clock is None or round_trip < self.clock[0]:
                    self.clock = (round_trip, offset)
                self.count("pongs")
            elif kind == wire.FORWARDED:
                (self.motion,) = wire.unpack(wire.FORWARDED_MESSAGE, message, self.session)
            elif kind == wire.BYE:
                wire.unpack(wire.BYE_MESSAGE, message, self.session)
                if not self.bye and not self.leaving:
                    self.say_bye()
                self.bye = True
                self.done.set()
            else:
                raise wire.Refused("kind")
        except wire.Refused as why:
            self.count(f"refused_{why}")

    def seal(self, message):
        """What opens messages from now on, if the sender has the link."""
        if message[1:5] != self.session.to_bytes(4, "little"):
            raise wire.Refused("session")
        return wire.Opener(self.link, self.avatar, self.motion, message[5:].decode(), self.exchange)

    def frame(self, arrived, message):
        sequence, captured, values, translation = wire.read_paper_frame(message, self.motion)
        if sequence == 0:
            raise wire.Refused("sequence")
        if sequence > self.newest:
            shift = sequence - self.newest
            # The one that was newest is itself a bit from now on.
            before = self.received << 1 | (1 if self.newest else 0)
            self.received = (before << shift - 1) & (1 << 64) - 1 if shift <= 64 else 0
            self.newest = sequence
        else:
            bit = self.newest - sequence - 1
            if bit < 0 or bit >= 64 or self.received >> bit & 1:
                self.count("stale")
                return
            self.received |= 1 << bit
            self.count("out_of_order")
        self.frames += 1
        self.bytes += len(message)
        self.arrivals.append((captured, arrived))
        if sequence in self.options.keep:
            one = {"sequence": sequence, "captured_us": captured, "translation": translation, "values": values}
            self.kept.append(one)
        if self.frames % 3 == 0:
            self.feedback()
        if self.frames >= self.options.frames:
            self.done.set()

    def feedback(self):
        if self.channel.readyState == "open":
            fields = (self.session, self.newest, self.received, wire.now_us())
            self.channel.send(wire.FEEDBACK_MESSAGE.pack(wire.FEEDBACK, *fields))
            self.count("feedbacks")

    def say_bye(self):
        if self.channel.readyState == "open":
            self.channel.send(wire.BYE_MESSAGE.pack(wire.BYE, self.session))

    async def keep_telling(self):
        while True:
            self.feedback()
            await asyncio.sleep(FEEDBACK_EVERY_S)

    async def room(self):
        """The announcement, once the sender is there."""
        while True:
            status, headers, body = await asyncio.to_thread(self.link.ask, "GET", self.link.room_path())
            if status == 200:
                return json.loads(body)
            if status != 503:
                raise RuntimeError(f"the server says {status}: {body.decode(errors='replace')}")
            await asyncio.sleep(min(1.0, float(headers.get("Retry-After", 1))))

    async def join(self, peer):
        announcement = await self.room()
        if announcement["codec"] != "paper":
            raise RuntimeError(f"the sender speaks {announcement['codec']}, this viewer reads paper frames only")
        motion, self.channel = open_channels(peer, announcement["channel"])
        motion.on("message", self.heard)
        opened = asyncio.Event()
        self.channel.on("open", opened.set)
        await peer.setLocalDescription(await peer.createOffer())
        path, offer = self.link.room_path("/whep"), peer.localDescription.sdp
        theirs, exchange = wire.fingerprints(offer), wire.base64url(self.exchange.public)
        offer = wire.before_media(offer, wire.EXCHANGE + exchange)
        offer = self.link.proved(offer, "viewer", [self.link.room, theirs, exchange])
        status, headers, body = await asyncio.to_thread(self.link.ask, "POST", path, offer, "application/sdp")
        if status != 201:
            raise RuntimeError(f"the server says {status} to our offer: {body.decode(errors='replace')}")
        answer = body.decode()
        self.avatar = announcement["avatar"]["sha256"]
        if "a=mon3tr-forwarder" in answer.splitlines():
            self.sealed = self.link.secret is not None
            self.exchange.accept(answer, self.link, self.avatar)
        elif not self.link.is_proved(answer, "sender", [self.link.room, self.avatar, wire.fingerprints(answer), theirs]):
            raise RuntimeError("the sender does not have the link")
        await peer.setRemoteDescription(RTCSessionDescription(answer, "answer"))
        await opened.wait()
        return announcement, headers["Location"]

    async def run(self):
        peer, telling, location, failed, announcement = new_peer(), None, None, None, None
        try:
            async with asyncio.timeout(self.options.timeout) if hasattr(asyncio, "timeout") else Patience(self.options.timeout):
                announcement, location = await self.join(peer)
                telling = asyncio.ensure_future(self.keep_telling())
                await self.done.wait()
            if self.frames < self.options.frames:
                failed = f"the sender said bye after {self.frames} frames"
        except (asyncio.TimeoutError, TimeoutError):
            failed = f"only {self.frames} frames came in {self.options.timeout} s"
        except (RuntimeError, OSError, ValueError, KeyError) as error:
            failed = f"{error}"
        if telling:
            telling.cancel()
        if location:
            said_by_them, self.leaving = self.bye, True
            for _ in range(round(wire.BYE_PATIENCE_S / 0.1)):
                if self.bye or self.channel.readyState != "open":
                    break
                self.say_bye()
                await asyncio.sleep(0.1)
            self.counts["bye_answered"] = int(self.bye and not said_by_them)
            # Until the last message was sent.
            await asyncio.sleep(0.1)
            try:
                status, _, _ = await asyncio.to_thread(self.link.ask, "DELETE", location)
                self.count(f"delete_{status}")
            except OSError as error:
                self.count(f"delete_{type(error).__name__}")
        await peer.close()
        print(json.dumps(self.report(announcement, failed)), flush=True)
        complete = self.frames >= self.options.frames and not any(one.startswith("refused_") for one in self.counts)
        return 0 if complete and not failed else 1

    def report(self, announcement, failed):
        latencies = []
        if self.clock:
            latencies = [(arrived - (captured - self.clock[1])) / 1000 for captured, arrived in self.arrivals]
        return {
            "announcement": announcement,
            "session": f"{self.session:08x}",
            "sealed": self.sealed,
            "frames": self.frames,
            "newest_sequence": self.newest,
            "never_came": self.newest - self.frames,
            "bytes": self.bytes,
            "bye": self.bye,
            "counts": self.counts,
            "round_trip_ms": self.clock and self.clock[0] / 1000,
            "clock_offset_us": self.clock and self.clock[1],
            "latency_ms": {f"p{part}": percentile(latencies, part / 100) for part in (50, 99)},
            "capture_in_order": all(a[0] <= b[0] for a, b in zip(self.arrivals, self.arrivals[1:])),
            "kept": self.kept,
            "failed": failed,
        }


class Patience:
    """asyncio.timeout for Python 3.10."""

    def __init__(self, seconds):
        self.seconds, self.over = seconds, False

    def strike(self, task):
        self.over = True
        task.cancel()

    async def __aenter__(self):
        task = asyncio.current_task()
        self.handle = asyncio.get_running_loop().call_later(self.seconds, self.strike, task)

    async def __aexit__(self, kind, *_):
        self.handle.cancel()
        if self.over and kind is asyncio.CancelledError:
            raise TimeoutError


async def main():
    parser = argparse.ArgumentParser(description="a viewer that is not ours")
    parser.add_argument("link", help="the room's link for viewers")
    parser.add_argument("--frames", type=int, default=90, help="end after so many")
    parser.add_argument("--timeout", type=float, default=20.0, help="seconds until it gives up")
    parser.add_argument("--keep", default="", help="sequences of the frames to print, with commas between")
    parser.add_argument("--address", help="connect from this address only, such as 127.0.0.1")
    options = parser.parse_args()
    options.keep = {int(one) for one in options.keep.split(",") if one}
    bind_to(options.address)
    return await Call(options).run()


if __name__ == "__main__":
    sys.exit(asyncio.run(main()))
