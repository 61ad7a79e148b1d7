//! A room's guests: the sender makes each a link of their own, and knows its guests by it.
//!
//! A guest's secret is the hash of the sender's signature of what it says of the guest, which only the sender can make, and makes again whenever the guest
//! comes: nothing is kept. Neither another viewer, who has the room's secret, too, nor the server can make one up.

use crate::{CallError, proof};
use identity::{Identity, Purpose};
use link_protocol::{Guest, GuestPass, LinkSecret, Name, RoomLink};
use ring::digest;

/// What a guest shows in its offer: `GUEST MAC`.
const LINE: &str = "a=mon3tr-guest:";

/// What the MAC's secret is of.
const OF_GUEST: &str = "guest";

/// What the link of `guest` to a room of the sender with this key has of them.
pub(crate) fn pass(own: &Identity, room: &Name, guest: Guest) -> GuestPass {
    let signature = own.sign(Purpose::Guest, format!("{room}\n{guest}").as_bytes());
    let digest = digest::digest(&digest::SHA256, signature.bytes());
    let mut secret = [0; 16];
    for (byte, of_digest) in secret.iter_mut().zip(digest.as_ref()) {
        *byte = *of_digest;
    }
    GuestPass {
        guest,
        secret: LinkSecret::new(secret),
    }
}

/// The line of a viewer whose link is a guest's, about `text`, which is of one connection.
pub(crate) fn line(room: &RoomLink, text: &str) -> String {
    let Some(GuestPass { guest, secret }) = room.guest() else {
        return String::new();
    };
    let mac = proof::prove(secret, Purpose::Viewer, OF_GUEST, text);
    format!("{LINE}{guest} {mac}\r\n")
}

/// Which guest of a room wrote the offer that has `line` and this text; nothing where it has none.
pub(crate) fn read(
    own: Option<&Identity>,
    room: &RoomLink,
    text: &str,
    line: Option<&str>,
) -> Result<Option<Guest>, CallError> {
    // Without a key this sender has made nobody its guest.
    let (Some(line), Some(own)) = (line, own) else {
        return Ok(None);
    };
    let (guest, mac) = line.split_once(' ').ok_or(CallError::NoLink)?;
    let guest: Guest = guest.parse().map_err(|_| CallError::NoLink)?;
    let GuestPass { guest, secret } = pass(own, room.room(), guest);
    proof::check(&secret, Purpose::Viewer, OF_GUEST, text, mac)?;
    Ok(Some(guest))
}

#[cfg(test)]
mod tests {
    use super::*;
    use data_encoding::BASE64URL_NOPAD;
    use link_protocol::{Rights, Token};

    fn own(seed: u8) -> Identity {
        Identity::from_seed(&[seed; 32]).expect("a key")
    }

    fn room(name: &str) -> RoomLink {
        let server = "http://127.0.0.1:1".parse().expect("an address");
        RoomLink::of(server, name, "token").expect("a room")
    }

    fn bob(expires: u64) -> Guest {
        Guest {
            name: "Bob".parse().expect("a name"),
            expires,
            rights: Rights::ALL,
            token: "t1".parse().expect("a name"),
        }
    }

    #[test]
    fn a_sender_knows_its_guests_and_nobody_elses() {
        let ada = own(1);
        let pass = pass(&ada, room("r").room(), bob(9));
        let token = Token::new("another").expect("a token");
        let theirs = room("r").for_guest(token, pass.clone());
        let again: RoomLink = theirs.to_string().parse().expect("a guest's link");
        assert_eq!(again, theirs);
        let shown = line(&theirs, "fingerprints");
        let offer = shown.strip_prefix(LINE).expect("a line").trim_end();
        let known = read(Some(&ada), &room("r"), "fingerprints", Some(offer));
        assert_eq!(known.expect("known"), Some(bob(9)));
        // By another sender, in another room, on another connection, for longer.
        let longer = offer.replace(".9.", ".99.");
        assert_ne!(longer, offer);
        for (own, room, text, offer) in [
            (&own(2), room("r"), "fingerprints", offer),
            (&ada, room("q"), "fingerprints", offer),
            (&ada, room("r"), "others", offer),
            (&ada, room("r"), "fingerprints", longer.as_str()),
        ] {
            let refused = read(Some(own), &room, text, Some(offer));
            assert!(matches!(refused, Err(CallError::NoLink)), "{refused:?}");
        }
        let none = read(Some(&ada), &room("r"), "fingerprints", None);
        assert_eq!(none.expect("no guest"), None);
        let keyless = read(None, &room("r"), "fingerprints", Some(offer));
        assert_eq!(keyless.expect("has no guests"), None);
    }

    /// RFC 8032 and SHA-256 by Python's `cryptography` and `hashlib`.
    #[test]
    fn a_secret_is_the_hash_of_a_signature() {
        let pass = pass(&own(1), room("r").room(), bob(9));
        assert_eq!(
            BASE64URL_NOPAD.encode(pass.secret.bytes()),
            "YjBEvzNMTsEfXqBTynNPoA"
        );
    }
}
