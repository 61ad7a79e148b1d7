#!/usr/bin/env python3
"""A viewer or a sender with the room's link that attacks the transport of the program at the other end: aiortc and docs/protocol.md.

    $MON3TR_PYTHON aiortc_attacker.py viewer LINK --attack NAME [--times 1] [--seconds 4] [--address 127.0.0.1]
    $MON3TR_PYTHON aiortc_attacker.py sender LINK --attack NAME --sha256 HASH --bytes N [...]

Attacks: `fragments` chains of DTLS fragments in clear, after the handshake; `early` records of the next epoch before it; `channels` opens
data channels in band; `streams` sends on SCTP streams of no channel; `holes` sends SCTP messages after one that never comes; `skips` gives
up SCTP messages that were never sent (RFC 3758); `resets` resets SCTP streams (RFC 6525); `rtp` and `rtcp` send packets that no honest
side sends; `certificate` has DTLS with another certificate than the one of the offer or answer.

Prints what was sent as one line of JSON.
"""

import argparse
import asyncio
import json
import random
import secrets
import struct
import sys

import aiortc_sender
import aiortc_viewer
import aiortc.rtcdtlstransport
import aiortc.rtcsctptransport as aiortc_sctp
from aiortc_peer import bind_to, new_peer

ATTACKS = ["fragments", "early", "channels", "streams", "holes", "skips", "resets", "rtp", "rtcp", "certificate"]
PAYLOAD_TYPE = 111
DCEP, STRING = 50, 51


def record(content, epoch, sequence, body):
    return struct.pack(">BHHHIH", content, 0xFEFD, epoch, sequence >> 32, sequence & 0xFFFFFFFF, len(body)) + body


def head(message, length, offset, part):
    return struct.pack(">B", 1) + length.to_bytes(3, "big") + struct.pack(">H", message) + offset.to_bytes(3, "big") + part.to_bytes(3, "big")


def fragments():
    """Datagrams with chains of fragments: for each message that may be the next one, forwards and backwards, as records of 110."""
    sequence = 1 << 40
    for message in range(10):
        for offsets in (list(range(1, 24_000)) + [0], list(range(24_000, -1, -1))):
            for at in range(0, len(offsets), 110):
                heads = b"".join(head(message, 0, offset, 1) for offset in offsets[at : at + 110])
                yield record(22, 0, sequence, heads)
                sequence += 1
        # With a byte each, as they should be, a few records in each datagram.
        for at in range(0, 2_000, 20):
            parts = (record(22, 0, sequence + k, head(message, 2_001, at + k, 1) + b"x") for k in range(20))
            yield b"".join(parts)
            sequence += 20
        # Of nothing.
        for _ in range(50):
            yield record(22, 0, sequence, head(message, 5, 0, 0) * 90)
            sequence += 1


def early():
    """Records of the next epoch, and changes of the cipher."""
    for sequence in range(6_000):
        yield record(random.choice((22, 23)), 1, sequence, bytes(1_100))
        yield record(20, 0, (1 << 30) + sequence, b"\1")


def rtp_packet(ssrc, sequence, timestamp, payload, kind=PAYLOAD_TYPE, first=0x80, more=b""):
    return struct.pack(">BBHII", first, kind, sequence & 0xFFFF, timestamp & 0xFFFFFFFF, ssrc) + more + payload


def rtp():
    """Packets of all sizes and kinds of the voice, whose times and numbers jump."""
    for number in range(6_000):
        ssrc = 7 if number % 3 else secrets.randbits(32)
        payload = secrets.token_bytes(random.choice((0, 1, 2, 40, 300, 1_200)))
        if number % 5 == 0:
            payload = bytes([random.randrange(256)]) * random.randrange(1, 1_200)
        sequence = number if number % 7 else secrets.randbits(16)
        timestamp = number * 960 if number % 11 else secrets.randbits(32)
        kind = PAYLOAD_TYPE | random.choice((0, 0x80)) if number % 4 else random.randrange(128)
        first, more = 0x80, b""
        if number % 6 == 0:
            words = random.choice((0, 1, 4, 60))
            first, more = 0x90, struct.pack(">HH", random.choice((0xBEDE, 0x1000, 0x1234)), words) + secrets.token_bytes(4 * words)
        elif number % 6 == 1:
            first, payload = 0xA0, payload + bytes([random.randrange(256)])
        elif number % 6 == 2:
            sources = random.randrange(1, 16)
            first, more = 0x80 | sources, secrets.token_bytes(4 * sources)
        yield rtp_packet(ssrc, sequence, timestamp, payload, kind, first, more)


def rtcp():
    """Reports and feedback with any contents: each says how long it is, and whom it is about."""
    for number in range(6_000):
        kind = random.choice((200, 201, 202, 203, 204, 205, 206, 207, 210))
        words = random.randrange(1, 40)
        ssrc = 7 if number % 3 else secrets.randbits(32)
        yield struct.pack(">BBHI", 0x80 | random.randrange(32), kind, words, ssrc) + secrets.token_bytes(4 * words - 4)


def open_message(number):
    label = b"x" * random.choice((1, 100, 1_000))
    return struct.pack("!BBHLHH", 3, 0, 0, 0, len(label), 0) + label


class Attack:
    """One connection's."""

    def __init__(self, options):
        self.options, self.sent = options, 0

    async def paced(self, dtls, send, packets):
        for packet in packets:
            if dtls.state in ("closed", "failed"):
                return
            try:
                await send(packet)
                self.sent += 1
            except Exception:  # what cannot be sent is not sent: the other packets count
                pass
            if self.sent % 20 == 0:
                await asyncio.sleep(0.005)

    async def on(self, peer):
        """After the connection is there."""
        sctp, dtls = peer.sctp, peer.sctp.transport
        for _ in range(self.options.times):
            if self.options.attack == "fragments":
                await self.paced(dtls, dtls.transport._send, fragments())
            elif self.options.attack == "rtp":
                await self.paced(dtls, dtls._send_rtp, rtp())
            elif self.options.attack == "rtcp":
                await self.paced(dtls, dtls._send_rtp, rtcp())
            elif self.options.attack == "channels":
                await self.paced(dtls, lambda number: sctp._send(number, DCEP, open_message(number)), range(2, 30_000))
            elif self.options.attack == "streams":
                await self.paced(dtls, lambda number: sctp._send(number, STRING, b"x"), range(2, 65_000))
            elif self.options.attack == "holes":
                await self.paced(dtls, lambda number: self.unordered(sctp, number), range(1, 20_000))

            elif self.options.attack == "skips":
                await self.paced(dtls, lambda number: self.skip(sctp, number), range(1, 6_000))
            elif self.options.attack == "resets":
                await self.paced(dtls, lambda number: self.reset(sctp, number), range(1, 6_000))

    async def skip(self, sctp, number):
        """Says that no message comes before one that is near, far or behind."""
        chunk = aiortc_sctp.ForwardTsnChunk()
        ahead = (number, 1 << random.randrange(32), secrets.randbits(32))[number % 3]
        chunk.cumulative_tsn = (sctp._local_tsn + ahead) & 0xFFFFFFFF
        chunk.streams = [(random.choice((0, 1, secrets.randbits(16))), secrets.randbits(16)) for _ in range(number % 200)]
        await sctp._send_chunk(chunk)

    async def reset(self, sctp, number):
        """Asks that streams begin again, all of them or some, with numbers of requests that follow each other or do not."""
        request = (sctp._reconfig_request_seq + number) & 0xFFFFFFFF if number % 2 else secrets.randbits(32)
        last = (sctp._local_tsn + random.choice((-1, 5, 1 << 20))) & 0xFFFFFFFF
        streams = [random.choice((0, 1, secrets.randbits(16))) for _ in range(number % 200)]
        parameter = aiortc_sctp.StreamResetOutgoingParam(request, secrets.randbits(32), last, streams)
        await sctp._send_reconfig_param(parameter)

    async def until_refused(self, peer):
        """Until the other side has ended DTLS, or ten seconds have passed."""
        for _ in range(100):
            if peer.sctp and peer.sctp.transport.state in ("closed", "failed"):
                return
            await asyncio.sleep(0.1)

    async def unordered(self, sctp, number):
        """A message of stream 0 so many after the next one, which is never sent."""
        chunk = aiortc_sctp.DataChunk(flags=aiortc_sctp.SCTP_DATA_UNORDERED | aiortc_sctp.SCTP_DATA_FIRST_FRAG | aiortc_sctp.SCTP_DATA_LAST_FRAG)
        chunk.tsn, chunk.stream_id, chunk.stream_seq = (sctp._local_tsn + number) & 0xFFFFFFFF, 0, 0
        chunk.protocol, chunk.user_data = 53, bytes(1_000)
        await sctp._send_chunk(chunk)

    def before_the_handshake(self):
        """Sends early records from the connection's own address, before DTLS begins."""
        handshake = aiortc.rtcdtlstransport.RTCDtlsTransport._do_handshake

        async def attacked(transport):
            for _ in range(self.options.times):
                await self.paced(transport, transport.transport._send, early())
            await handshake(transport)

        aiortc.rtcdtlstransport.RTCDtlsTransport._do_handshake = attacked

    def with_another_certificate(self):
        """Has each DTLS connection begin with a certificate that no offer or answer names."""
        start = aiortc.rtcdtlstransport.RTCDtlsTransport.start

        async def attacked(transport, parameters):
            transport._RTCDtlsTransport__local_certificate = aiortc.RTCCertificate.generateCertificate()
            self.sent += 1
            await start(transport, parameters)

        aiortc.rtcdtlstransport.RTCDtlsTransport.start = attacked


class Viewer(aiortc_viewer.Call):
    """Sends feedback as a viewer does, and attacks."""

    def __init__(self, options, attack):
        super().__init__(options)
        self.attack = attack

    async def run(self):
        peer = new_peer()
        joining = asyncio.ensure_future(self.join(peer))
        if self.options.attack == "certificate":
            await self.attack.until_refused(peer)
        else:
            await asyncio.wait([joining], timeout=self.options.seconds + 10)
        if joining.done() and not joining.exception():
            telling = asyncio.ensure_future(self.keep_telling())
            await self.attack.on(peer)
            await asyncio.sleep(self.options.seconds)
            telling.cancel()
        elif joining.done():
            print(f"did not join: {joining.exception()!r}", file=sys.stderr)
        joining.cancel()
        return {"frames": self.frames}


class Sender(aiortc_sender.Sender):
    """Sends frames as a sender does, and attacks each viewer."""

    def __init__(self, options, attack):
        super().__init__(options)
        self.attack, self.over = attack, asyncio.Event()
        # Its base class would say bye after so long.
        self.stays, options.seconds = options.seconds, None

    async def answer(self, name, offer):
        await super().answer(name, offer)
        if name in self.viewers:
            asyncio.ensure_future(self.attack_viewer(self.viewers[name]))

    async def attack_viewer(self, viewer):
        if self.options.attack == "certificate":
            await self.attack.until_refused(viewer.peer)
        elif self.options.attack != "early":
            while viewer.session is None:
                await asyncio.sleep(0.05)
        await self.attack.on(viewer.peer)
        await asyncio.sleep(self.stays)
        self.over.set()

    async def until_it_is_over(self):
        """It goes without a bye, so that the viewer waits for the next one."""
        running = asyncio.ensure_future(self.run())
        await asyncio.wait([asyncio.ensure_future(self.over.wait()), running], timeout=60, return_when=asyncio.FIRST_COMPLETED)
        running.cancel()
        return self.counts


async def main():
    parser = argparse.ArgumentParser(description="a viewer or a sender that attacks")
    parser.add_argument("who", choices=["viewer", "sender"])
    parser.add_argument("link", help="the room's link for it")
    parser.add_argument("--attack", required=True, choices=ATTACKS)
    parser.add_argument("--times", type=int, default=1, help="how often")
    parser.add_argument("--seconds", type=float, default=4.0, help="how long it stays after it")
    parser.add_argument("--sha256", help="hash of an avatar package that the server has")
    parser.add_argument("--bytes", type=int, help="the package's size")
    parser.add_argument("--address", help="connect from this address only, such as 127.0.0.1")
    options = parser.parse_args()
    options.rate, options.channel, options.frames, options.keep = 30.0, "unreliable", 1 << 60, {}
    bind_to(options.address)
    attack = Attack(options)
    if options.attack == "early":
        attack.before_the_handshake()
    if options.attack == "certificate":
        attack.with_another_certificate()
    counts = {}
    if options.who == "viewer":
        counts = await Viewer(options, attack).run()
    else:
        counts = await Sender(options, attack).until_it_is_over()
    print(json.dumps({"sent": attack.sent, **counts}), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(asyncio.run(main()))
