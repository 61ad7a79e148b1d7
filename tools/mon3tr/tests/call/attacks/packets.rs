//! Hosts without a link send DTLS, SCTP, STUN and RTP packets to the ports of a call.
