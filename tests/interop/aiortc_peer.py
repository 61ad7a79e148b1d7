"""aiortc peer connections as the protocol wants them: all candidates in the description, no STUN server asked."""

import aioice.ice
from aiortc import RTCConfiguration, RTCPeerConnection


def bind_to(address):
    """From now on connections are made from this address only. By itself aioice leaves loopback out."""
    if address:
        aioice.ice.get_host_addresses = lambda use_ipv4, use_ipv6: [address]


def new_peer():
    """A connection that asks nobody on the internet where it is."""
    return RTCPeerConnection(RTCConfiguration(iceServers=[]))
