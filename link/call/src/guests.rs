//! A room's guests: the sender makes each a link of their own, and knows its guests by it.
//!
//! A guest's secret is the hash of the sender's signature of what it says of the guest, which only the sender can make, and makes again whenever the guest
//! comes: nothing is kept. Neither another viewer, who has the room's secret, too, nor the server can make one up.

use crate::CallError;
use crate::introduction::{Credentials, only};
use data_encoding::BASE64URL_NOPAD;
use identity::Purpose;
use link_protocol::{Guest, GuestPass, GuestSecret, Name, RoomLink};
use ring::{digest, hmac};

/// What a guest shows in its offer: `GUEST MAC`.
const GUEST_LINE: &str = "a=mon3tr-guest:";

impl Credentials {
    /// What the link of `guest` to a room of this sender has of them.
    #[must_use]
    pub fn pass(&self, room: &Name, guest: Guest) -> GuestPass {
        let signature = self.sign(Purpose::Guest, &format!("{room}\n{guest}"));
        let digest = digest::digest(&digest::SHA256, signature.bytes());
        let mut secret = [0; 16];
        for (byte, of_digest) in secret.iter_mut().zip(digest.as_ref()) {
            *byte = *of_digest;
        }
        GuestPass {
            guest,
            secret: GuestSecret::new(secret),
        }
    }
}

/// The line of a viewer whose link is a guest's, about `text`, which is of one connection.
pub(crate) fn line(room: &RoomLink, text: &str) -> String {
    let Some(GuestPass { guest, secret }) = room.guest() else {
        return String::new();
    };
    let mac = hmac::sign(&mac_key(secret), text.as_bytes());
    let mac = BASE64URL_NOPAD.encode(mac.as_ref());
    format!("{GUEST_LINE}{guest} {mac}\r\n")
}

/// Which guest of a room wrote `offer`, whose text this is; nothing where none did.
pub(crate) fn read(
    own: Option<&Credentials>,
    room: &RoomLink,
    text: &str,
    offer: &str,
) -> Result<Option<Guest>, CallError> {
    // Without a key this sender has made nobody its guest.
    let (Some(line), Some(own)) = (only(offer, GUEST_LINE)?, own) else {
        return Ok(None);
    };
    let (guest, mac) = line.split_once(' ').ok_or(CallError::NoLink)?;
    let guest: Guest = guest.parse().map_err(|_| CallError::NoLink)?;
    let mac = BASE64URL_NOPAD.decode(mac.as_bytes());
    let mac = mac.map_err(|_| CallError::NoLink)?;
    let GuestPass { guest, secret } = own.pass(room.room(), guest);
    let is_theirs = hmac::verify(&mac_key(&secret), text.as_bytes(), &mac).is_ok();
    is_theirs.then_some(Some(guest)).ok_or(CallError::NoLink)
}

fn mac_key(secret: &GuestSecret) -> hmac::Key {
    let secret = hmac::Key::new(hmac::HMAC_SHA256, secret.bytes());
    let key = hmac::sign(&secret, &Purpose::Viewer.text(b"guest"));
    hmac::Key::new(hmac::HMAC_SHA256, key.as_ref())
}

#[cfg(test)]
mod tests {
    use super::*;
    use identity::Identity;
    use link_protocol::{Rights, Token};

    fn own(seed: u8) -> Credentials {
        Credentials::new(Identity::from_seed(&[seed; 32]).expect("a key"))
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
        }
    }

    #[test]
    fn a_sender_knows_its_guests_and_nobody_elses() {
        let ada = own(1);
        let pass = ada.pass(room("r").room(), bob(9));
        let token = Token::new("another").expect("a token");
        let theirs = room("r").for_guest(token, pass.clone());
        let again: RoomLink = theirs.to_string().parse().expect("a guest's link");
        assert_eq!(again, theirs);
        let offer = line(&theirs, "fingerprints");
        let known = read(Some(&ada), &room("r"), "fingerprints", &offer);
        assert_eq!(known.expect("known"), Some(bob(9)));
        // By another sender, in another room, on another connection, for longer.
        let longer = offer.replace(".9.", ".99.");
        assert_ne!(longer, offer);
        for (own, room, text, offer) in [
            (&own(2), room("r"), "fingerprints", &offer),
            (&ada, room("q"), "fingerprints", &offer),
            (&ada, room("r"), "others", &offer),
            (&ada, room("r"), "fingerprints", &longer),
        ] {
            let refused = read(Some(own), &room, text, offer);
            assert!(matches!(refused, Err(CallError::NoLink)), "{refused:?}");
        }
        let none = read(Some(&ada), &room("r"), "fingerprints", "v=0\r\n");
        assert_eq!(none.expect("no guest"), None);
        let keyless = read(None, &room("r"), "fingerprints", &offer);
        assert_eq!(keyless.expect("has no guests"), None);
    }

    /// RFC 8032 and SHA-256 by Python's `cryptography` and `hashlib`.
    #[test]
    fn a_secret_is_the_hash_of_a_signature() {
        let pass = own(1).pass(room("r").room(), bob(9));
        assert_eq!(
            BASE64URL_NOPAD.encode(pass.secret.bytes()),
            "pb60sHYTaDD5SKCnLctSHw"
        );
    }
}
