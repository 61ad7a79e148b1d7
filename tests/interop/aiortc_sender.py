#!/usr/bin/env python3
"""An independent sender: aiortc and docs/protocol.md. Sends a waving arm to every viewer that joins, as `paper` frames.

    $MON3TR_PYTHON aiortc_sender.py LINK --sha256 HASH --bytes N [--rate 30] [--channel unreliable] [--seconds S] [--address 127.0.0.1]

Prints one line `ready` once it is present in the room. Sends byes and prints its statistics as JSON when it is asked to end (SIGTERM,
SIGINT) or its seconds are over. Exits with 1 if its token was refused or it was replaced.
"""

import argparse
import asyncio
import json
import math
import signal
import sys
import threading
import time

import wire
from aiortc import RTCSessionDescription
from aiortc_peer import answer_passively, bind_to, new_peer, open_channels

SILENCE_US = 4_000_000
BUFFER_BYTES = 4000
LEFT_SHOULDER, LEFT_ELBOW = 16, 18


def waving(seconds):
    """The motion at a moment: 215 numbers, and where the person stands. The left arm is up and its forearm waves."""
    values = [0.0] * wire.PARAMS
    values[3 * LEFT_SHOULDER + 2] = 0.9
    values[3 * LEFT_ELBOW + 2] = 0.6 + 0.5 * math.sin(2 * math.pi * 0.8 * seconds)
    return values, (0.0, 0.02 * math.sin(2 * math.pi * 0.4 * seconds), 0.0)


class Viewer:
    """One connection, from its offer on."""

    def __init__(self, peer):
        # Nothing is sent to it before its session is known.
        self.peer, self.channel, self.session = peer, None, None
        self.sequence, self.heard, self.acknowledged, self.said_bye = 0, wire.now_us(), 0, False
        # It has said bye itself.
        self.gone = False


class Sender:
    """All viewers, and the room's presence stream in a thread of its own."""

    def __init__(self, options):
        self.options, self.link = options, wire.Link(options.link)
        self.viewers, self.counts, self.end = {}, {}, asyncio.Event()
        self.loop, self.failed, self.stream = asyncio.get_running_loop(), None, None

    def count(self, what, by=1):
        self.counts[what] = self.counts.get(what, 0) + by

    def stop(self, why=None):
        self.failed = self.failed or why
        self.end.set()

    # In the thread.

    def stay_present(self):
        announcement = {
            "avatar": {"sha256": self.options.sha256, "bytes": self.options.bytes},
            "channel": self.options.channel,
            "codec": "paper",
            "rate_hz": self.options.rate,
        }
        body = json.dumps(announcement)
        while not self.end.is_set():
            try:
                connection, answer = self.link.open("POST", self.link.room_path("/presence"), body, "application/json")
                self.stream = connection
                if answer.status in (400, 401, 403, 404):
                    why = f"the server refuses presence: {answer.status} {answer.read().decode(errors='replace')}"
                    self.loop.call_soon_threadsafe(self.stop, why)
                    return
                if answer.status == 200:
                    self.loop.call_soon_threadsafe(self.count, "presence_opened")
                    print("ready", flush=True)
                    for name, data in wire.events(answer):
                        self.loop.call_soon_threadsafe(self.heard_event, name, data)
                        if name == "replaced":
                            return
            except (OSError, wire.http.client.HTTPException, ValueError):
                pass
            time.sleep(0.3)

    # In the loop.

    def heard_event(self, name, data):
        self.count({"": "comments", "offer": "offers", "leave": "leaves"}.get(name, name))
        if name == "offer":
            asyncio.ensure_future(self.answer(data["session"], data["sdp"]))
        elif name == "leave":
            asyncio.ensure_future(self.drop(data["session"]))
        elif name == "replaced":
            self.stop("another sender came with the same token")

    async def answer(self, name, offer):
        viewer = self.viewers[name] = Viewer(new_peer())
        try:
            await viewer.peer.setRemoteDescription(RTCSessionDescription(offer, "offer"))
            viewer.channel, feedback = open_channels(viewer.peer, self.options.channel)
            feedback.on("message", lambda message: self.heard(name, viewer, message))
            sdp = await answer_passively(viewer.peer)
        except Exception as error:  # aiortc has no error type of its own for what it cannot read
            print(f"cannot answer {name}: {error!r}", file=sys.stderr)
            self.count("offers_refused")
            await self.drop(name)
            return
        path = self.link.room_path(f"/sessions/{name}/answer")
        try:
            status, _, _ = await asyncio.to_thread(self.link.ask, "PUT", path, sdp, "application/sdp")
        except OSError:
            status = 0
        self.count("answers" if status == 204 else f"answers_{status}")

    def heard(self, name, viewer, message):
        arrived = wire.now_us()
        try:
            kind = message[0] if isinstance(message, bytes) and message else None
            if kind == wire.FEEDBACK:
                if viewer.session is None and len(message) == wire.FEEDBACK_MESSAGE.size:
                    viewer.session = wire.FEEDBACK_MESSAGE.unpack(message)[1]
                    self.count("viewers")
                newest, _, sent = wire.unpack(wire.FEEDBACK_MESSAGE, message, viewer.session)
                viewer.heard, viewer.acknowledged = arrived, max(viewer.acknowledged, newest)
                self.count("feedbacks")
                if sent:
                    viewer.channel.send(wire.PONG_MESSAGE.pack(wire.PONG, viewer.session, sent, arrived, wire.now_us()))
                    self.count("pongs")
            elif kind == wire.BYE:
                wire.unpack(wire.BYE_MESSAGE, message, viewer.session)
                self.count("byes_heard")
                viewer.gone = True
                if not viewer.said_bye:
                    self.say_bye(viewer)
                    # After the answer was sent.
                    self.loop.call_later(0.1, lambda: asyncio.ensure_future(self.drop(name)))
            else:
                raise wire.Refused("kind")
        except wire.Refused as why:
            self.count(f"refused_{why}")

    def speaks_to(self, viewer):
        return not viewer.gone and viewer.session is not None and viewer.channel.readyState == "open"

    def say_bye(self, viewer):
        if viewer.channel.readyState == "open":
            viewer.channel.send(wire.BYE_MESSAGE.pack(wire.BYE, viewer.session))
            viewer.said_bye = True
            self.count("byes_said")

    async def drop(self, name):
        viewer = self.viewers.pop(name, None)
        if viewer:
            await viewer.peer.close()

    def send_frames(self):
        captured = wire.now_us()
        values, translation = waving(captured / 1e6)
        for name, viewer in list(self.viewers.items()):
            if captured - viewer.heard > SILENCE_US:
                self.count("silent_viewers")
                asyncio.ensure_future(self.drop(name))
            elif self.speaks_to(viewer):
                viewer.sequence += 1
                if viewer.channel.bufferedAmount > BUFFER_BYTES:
                    self.count("frames_skipped")
                    continue
                # Both ways of packing are the protocol's.
                packing = wire.STORED if viewer.sequence % 8 == 0 else wire.LZ4
                viewer.channel.send(wire.paper_frame(viewer.session, viewer.sequence, captured, values, translation, packing))
                self.count("frames_sent")

    async def run(self):
        for one in (signal.SIGTERM, signal.SIGINT):
            self.loop.add_signal_handler(one, self.stop)
        if self.options.seconds:
            self.loop.call_later(self.options.seconds, self.stop)
        threading.Thread(target=self.stay_present, daemon=True).start()
        due = self.loop.time()
        while not self.end.is_set():
            self.send_frames()
            due = max(due + 1 / self.options.rate, self.loop.time() - 1)
            try:
                await asyncio.wait_for(self.end.wait(), max(0, due - self.loop.time()))
            except asyncio.TimeoutError:
                pass
        until = self.loop.time() + wire.BYE_PATIENCE_S
        while self.loop.time() < until:
            left = [one for one in self.viewers.values() if self.speaks_to(one)]
            if not left:
                break
            for viewer in left:
                self.say_bye(viewer)
            await asyncio.sleep(0.1)
        newest = [{"sequence": one.sequence, "acknowledged": one.acknowledged} for one in self.viewers.values()]
        await asyncio.gather(*(self.drop(name) for name in list(self.viewers)))
        print(json.dumps({**self.counts, "viewers_at_end": newest, "failed": self.failed}), flush=True)
        return 1 if self.failed else 0


async def main():
    parser = argparse.ArgumentParser(description="a sender that is not ours")
    parser.add_argument("link", help="the room's link for its sender")
    parser.add_argument("--sha256", required=True, help="hash of an avatar package that the server has")
    parser.add_argument("--bytes", type=int, required=True, help="the package's size")
    parser.add_argument("--rate", type=float, default=30.0, help="frames a second")
    parser.add_argument("--channel", choices=["unreliable", "reliable"], default="unreliable")
    parser.add_argument("--seconds", type=float, help="end by itself after so long")
    parser.add_argument("--address", help="connect from this address only, such as 127.0.0.1")
    options = parser.parse_args()
    bind_to(options.address)
    return await Sender(options).run()


if __name__ == "__main__":
    sys.exit(asyncio.run(main()))
