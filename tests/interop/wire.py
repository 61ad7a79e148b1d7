"""The wire of docs/protocol.md for programs that are not ours, written from that page alone: nothing of Mon3tr is called.

Links and requests of a room, messages of the data channel, `paper` frames with LZ4 in plain Python. No `compact` frames.
"""

import base64
import hmac
import http.client
import json
import struct
import time
import urllib.parse

PAPER, COMPACT, FEEDBACK, PONG, STATE, FORWARDED, SEALED, SEAL, BYE = 1, 2, 16, 17, 18, 19, 20, 21, 31
PARAMS = 215
PAPER_BODY = struct.Struct(f"<{PARAMS}e3f")
BODY = PAPER_BODY.size
PAPER_HEADER = struct.Struct("<BBIIQB")
FEEDBACK_MESSAGE = struct.Struct("<BIIQQ")
PONG_MESSAGE = struct.Struct("<BIQQQ")
STATE_MESSAGE = struct.Struct("<BIBQ")
FORWARDED_MESSAGE = struct.Struct("<BII")
SEALED_HEADER = struct.Struct("<BII")
EXCHANGE = "a=mon3tr-exchange:"
BYE_MESSAGE = struct.Struct("<BI")
STORED, LZ4 = 0, 1
# The side that leaves sends byes until one is answered, but no longer than this.
BYE_PATIENCE_S = 1.5


class Refused(Exception):
    """A message does not follow the protocol; its text is the reason that it is counted under."""


def now_us():
    """Microseconds of this program's own clock."""
    return time.monotonic_ns() // 1000


def base64url(data):
    """Its text, without padding."""
    return base64.urlsafe_b64encode(data).decode().rstrip("=")


def of_base64url(text):
    """The bytes of such a text."""
    return base64.urlsafe_b64decode(text + "=" * (-len(text) % 4))


def before_media(sdp, line):
    """`sdp` with a line of the whole session."""
    before, medium, rest = sdp.partition("\nm=")
    return f"{before}\n{line}\r{medium}{rest}"


def fingerprints(sdp):
    """The fingerprints in an offer or answer, as the proofs about them have them."""
    head = "a=fingerprint:"
    return ",".join(sorted({line[len(head):].strip().lower() for line in sdp.splitlines() if line.startswith(head)}))


class Link:
    """`http://HOST:PORT/rooms/ROOM#TOKEN[:secret=SECRET][:key=KEY]`."""

    def __init__(self, text):
        parts = urllib.parse.urlsplit(text)
        before, found, room = parts.path.partition("/rooms/")
        if parts.scheme not in ("http", "https") or not parts.netloc or not found or not room or not parts.fragment:
            raise ValueError("this is not a link: it should read http://HOST:PORT/rooms/ROOM#TOKEN")
        self.tls, self.host, self.base = parts.scheme == "https", parts.netloc, before
        self.room, (self.token, *rest) = room.strip("/"), parts.fragment.split(":")
        named = dict(part.split("=", 1) for part in rest if "=" in part)
        self.secret = of_base64url(named["secret"]) if "secret" in named else None

    def proved(self, sdp, who, lines):
        """`sdp` with the line that shows that `who` ("viewer" or "sender") has the link; `lines` are what the MAC is of."""
        if self.secret is None:
            return sdp
        return before_media(sdp, f"a=mon3tr-link:{self.mac(who, lines)}")

    def is_proved(self, sdp, who, lines):
        """Whether `who` wrote `sdp` and has the link."""
        if self.secret is None:
            return True
        macs = [line[len("a=mon3tr-link:"):].strip() for line in sdp.splitlines() if line.startswith("a=mon3tr-link:")]
        return len(macs) == 1 and hmac.compare_digest(macs[0], self.mac(who, lines))

    def mac(self, who, lines):
        key = hmac.digest(self.secret, f"mon3tr {who} 1\nlink".encode(), "sha256")
        return base64url(hmac.digest(key, "\n".join(lines).encode(), "sha256"))

    def open(self, method, path, body=None, content_type=None, timeout=15):
        """Sends one request to a path below the server's address; gives the connection and the answer's head."""
        kind = http.client.HTTPSConnection if self.tls else http.client.HTTPConnection
        connection = kind(self.host, timeout=timeout)
        headers = {"Authorization": f"Bearer {self.token}"}
        if content_type:
            headers["Content-Type"] = content_type
        connection.request(method, self.base + path, body, headers)
        return connection, connection.getresponse()

    def ask(self, method, path, body=None, content_type=None):
        """Status, headers and body of one request."""
        connection, answer = self.open(method, path, body, content_type)
        try:
            return answer.status, answer.headers, answer.read()
        finally:
            connection.close()

    def room_path(self, below=""):
        """The path of the room, or of what lies below it."""
        return f"/v1/rooms/{self.room}{below}"


class Exchange:
    """A viewer's half of the agreement on the keys of what a forwarder hands on, and the keys of the epochs."""

    def __init__(self):
        # Only a viewer needs it: it comes with aiortc.
        from cryptography.hazmat.primitives.asymmetric.x25519 import X25519PrivateKey

        self.private = X25519PrivateKey.generate()
        self.public = self.private.public_key().public_bytes_raw()
        self.cipher, self.epochs = None, {}

    def accept(self, answer, link, avatar):
        """Takes the sender's half, with the key of the newest epoch."""
        from cryptography.hazmat.primitives.asymmetric.x25519 import X25519PublicKey
        from cryptography.hazmat.primitives.ciphers.aead import ChaCha20Poly1305
        from cryptography.hazmat.primitives.hashes import SHA256
        from cryptography.hazmat.primitives.kdf.hkdf import HKDF

        halves = [line[len(EXCHANGE):].strip() for line in answer.splitlines() if line.startswith(EXCHANGE)]
        if len(halves) != 1:
            raise Refused("exchange")
        sender, epoch, sealed = halves[0].split(" ")
        sender = of_base64url(sender)
        if not link.is_proved(answer, "exchange", [link.room, avatar, base64url(self.public), halves[0]]):
            raise Refused("exchange")
        info = f"mon3tr exchange 1\n{link.room}\n{avatar}\n".encode() + self.public + sender
        agreed = self.private.exchange(X25519PublicKey.from_public_bytes(sender))
        self.cipher = ChaCha20Poly1305(HKDF(SHA256(), 32, link.secret, info).derive(agreed))
        self.learn(int(epoch), of_base64url(sealed))

    def learn(self, epoch, sealed):
        """Takes the key of a newer epoch than those before, of which the last one is kept."""
        from cryptography.exceptions import InvalidTag

        if epoch <= max(self.epochs, default=0):
            return
        try:
            key = self.cipher.decrypt(bytes(8) + epoch.to_bytes(4, "little"), sealed, None)
        except InvalidTag:
            return
        self.epochs = {epoch: key, **dict(sorted(self.epochs.items())[-1:])}

    def take(self, message):
        """Takes a message of keys; the one of this viewer, if it is there."""
        epoch = int.from_bytes(message[:4], "little")
        for at in range(4, len(message) - 55, 56):
            if message[at : at + 8] == self.public[:8]:
                self.learn(epoch, message[at + 8 : at + 56])


class Opener:
    """Opens what a sender sealed, by the lines of its seal and the keys of the epochs."""

    def __init__(self, link, avatar, session, lines, exchange):
        seals = [line[len("a=mon3tr-seal:"):] for line in lines.splitlines() if line.startswith("a=mon3tr-seal:")]
        if len(seals) != 1 or not link.is_proved(lines, "seal", [link.room, avatar, seals[0]]):
            raise Refused("seal")
        salt, sealed_at, messages, _ = seals[0].split(" ")
        if abs(time.time() - int(sealed_at)) > 300:
            raise Refused("old_seal")
        self.text = f"mon3tr seal 1\nkey\n{link.room}\n{avatar}\n{salt}".encode()
        self.secret, self.exchange, self.session, self.messages = link.secret, exchange, session, int(messages)

    def message(self, sealed):
        """The message within, or nothing; keys are taken."""
        if len(sealed) < SEALED_HEADER.size:
            return None
        for _, key in sorted(self.exchange.epochs.items(), reverse=True):
            opened = self.opened(key, sealed)
            if opened is not None:
                return opened
        keys = self.opened(self.secret, sealed)
        if keys is not None:
            self.exchange.take(keys)
        return None

    def opened(self, secret, sealed):
        from cryptography.exceptions import InvalidTag
        from cryptography.hazmat.primitives.ciphers.aead import ChaCha20Poly1305

        kind, session, counter = SEALED_HEADER.unpack_from(sealed)
        if kind != SEALED or session != self.session or counter <= self.messages:
            return None
        nonce = bytes(8) + counter.to_bytes(4, "little")
        try:
            cipher = ChaCha20Poly1305(hmac.digest(secret, self.text, "sha256"))
            return cipher.decrypt(nonce, sealed[SEALED_HEADER.size:], sealed[:SEALED_HEADER.size])
        except InvalidTag:
            return None


def events(answer):
    """(name, data) of every event of a `text/event-stream`, ("", None) for every comment; ends with the stream."""
    name, data = "", []
    for raw in answer:
        line = raw.decode().rstrip("\r\n")
        if line.startswith(":"):
            yield "", None
        elif line.startswith("event:"):
            name = line[6:].strip()
        elif line.startswith("data:"):
            data.append(line[5:].removeprefix(" "))
        elif not line and data:
            yield name, json.loads("\n".join(data))
            name, data = "", []
        elif not line and name:
            yield name, None
            name = ""


def lz4_block(plain):
    """An LZ4 block, by the format's own rules: the last five bytes are literals, no match begins in the last twelve."""
    out, seen, literal, at = bytearray(), {}, 0, 0

    def length(value):
        while value >= 255:
            out.append(255)
            value -= 255
        out.append(value)

    def sequence(literals, back=0, copied=4):
        out.append(min(len(literals), 15) << 4 | min(copied - 4, 15))
        if len(literals) >= 15:
            length(len(literals) - 15)
        out.extend(literals)
        if back:
            out.extend(struct.pack("<H", back))
            if copied - 4 >= 15:
                length(copied - 4 - 15)

    while at + 12 <= len(plain):
        four = plain[at : at + 4]
        before, seen[four] = seen.get(four, -1), at
        if before < 0 or at - before > 0xFFFF:
            at += 1
            continue
        end = at + 4
        while end < len(plain) - 5 and plain[end] == plain[before + end - at]:
            end += 1
        sequence(plain[literal:at], at - before, end - at)
        literal = at = end
    sequence(plain[literal:])
    return bytes(out)


def lz4_unblock(block, size):
    """What an LZ4 block unpacks to; refused unless that is exactly `size` bytes."""
    out, at = bytearray(), 0

    def length(first):
        nonlocal at
        total = first
        while first == 15:
            total += block[at]
            at += 1
            if block[at - 1] != 255:
                break
        return total

    try:
        while True:
            token = block[at]
            at += 1
            literals = length(token >> 4)
            if at + literals > len(block):
                raise Refused("lz4")
            out += block[at : at + literals]
            at += literals
            if at == len(block):
                break
            back = block[at] | block[at + 1] << 8
            at += 2
            copied = length(token & 15) + 4
            if not 0 < back <= len(out) or len(out) + copied > size:
                raise Refused("lz4")
            # One by one: what is copied may reach into itself.
            for _ in range(copied):
                out.append(out[-back])
    except IndexError:
        raise Refused("lz4") from None
    if len(out) != size:
        raise Refused("lz4")
    return bytes(out)


def paper_frame(session, sequence, captured, values, translation, packing=LZ4):
    """The message of one frame: 215 numbers and the root translation in metres. What LZ4 would only lengthen is stored."""
    body = plain = PAPER_BODY.pack(*values, *translation)
    if packing == LZ4:
        body = lz4_block(plain)
        if len(body) >= BODY:
            packing, body = STORED, plain
    return PAPER_HEADER.pack(PAPER, 1, session, sequence, captured, packing) + body


def read_paper_frame(message, session):
    """(sequence, capture time, values, translation) of a `paper` message."""
    if len(message) < PAPER_HEADER.size:
        raise Refused("length")
    _, version, of_session, sequence, captured, packing = PAPER_HEADER.unpack_from(message)
    if version != 1:
        raise Refused("version")
    if of_session != session:
        raise Refused("session")
    body = message[PAPER_HEADER.size :]
    if packing == LZ4:
        body = lz4_unblock(body, BODY)
    elif packing != STORED or len(body) != BODY:
        raise Refused("length")
    numbers = PAPER_BODY.unpack(body)
    values, translation = numbers[:PARAMS], numbers[PARAMS:]
    # NaN is the one number that is not below any bound.
    if not all(abs(value) < 1000 for value in (*values, *translation)):
        raise Refused("range")
    return sequence, captured, values, translation


def unpack(layout, message, session):
    """The fields of a message of fixed layout, without kind and session."""
    if len(message) != layout.size:
        raise Refused("length")
    _, of_session, *fields = layout.unpack(message)
    if of_session != session:
        raise Refused("session")
    return fields
