"""aiortc peer connections as the protocol requires: all candidates in the description, no STUN server asked, one data channel for
each direction, and a sender that waits for the viewer to begin."""

import aioice.ice
from aiortc import RTCConfiguration, RTCPeerConnection, RTCSessionDescription


def bind_to(address):
    """From now on connections are made from this address only. By itself aioice leaves loopback out."""
    if address:
        aioice.ice.get_host_addresses = lambda use_ipv4, use_ipv6: [address]


def new_peer():
    """A connection that asks no server on the internet for its address."""
    return RTCPeerConnection(RTCConfiguration(iceServers=[]))


def open_channels(peer, channel):
    """The motion and the feedback channel, as `unreliable` or `reliable` as the announcement says."""
    how = {"ordered": False, "maxRetransmits": 0} if channel == "unreliable" else {"ordered": True}
    how |= {"protocol": "mon3tr.1", "negotiated": True}
    return peer.createDataChannel("motion", id=0, **how), peer.createDataChannel("feedback", id=1, **how)


async def answer_passively(peer):
    """Answers the offer that was set; the other side begins DTLS. by default aiortc would."""
    answer = await peer.createAnswer()
    sdp = answer.sdp.replace("a=setup:active", "a=setup:passive")
    await peer.setLocalDescription(RTCSessionDescription(sdp, "answer"))
    return peer.localDescription.sdp
