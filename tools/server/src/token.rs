//! Tokens: what their bearer may do, with a MAC by the server's secret.
//!
//! A token is a capability: nothing about a room or an owner is kept anywhere, so any instance that has the secret
//! checks any token, and a restart forgets nothing. Each has a name, by which it can be taken back before it expires: an operator's list has those of any
//! kind ([`crate::revoked`]), a sender tells those of its viewers.

use crate::{Id, Secret, ServerError};
use base64::Engine;
use base64::engine::general_purpose::URL_SAFE_NO_PAD;
use hmac::{Hmac, Mac};
use link_protocol::limits::{MAX_PEOPLE, SEATS_PER_ADDRESS};
use sha2::Sha256;
use std::net::IpAddr;
use std::time::{SystemTime, UNIX_EPOCH};
use turn_server::network_prefix;

/// Of a token that was made with no other one, as an operator makes them, and of all tokens of earlier versions.
const VERSION: u8 = 2;
const CLAIMS_BYTES: usize = 58;
/// Of a token that was made with another one: it has the names of that one, and of the one that that one was made with.
const DERIVED_VERSION: u8 = 3;
const DERIVED_CLAIMS_BYTES: usize = CLAIMS_BYTES + 32;
const MAC_BYTES: usize = 32;

/// A bearer's role.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Role {
    /// Opens rooms, puts packages.
    Owner = 1,
    /// Is present in one room.
    Sender = 2,
    /// Joins one room.
    Viewer = 3,
    /// Takes a seat of one call, and joins whoever has another.
    Member = 4,
}

/// The content of a genuine token.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Claims {
    pub(crate) role: Role,
    /// The owner, or the room's owner.
    pub(crate) owner: Id,
    /// The room, or the call; all zero for an owner's token, and no handler looks at it then.
    room: Id,
    /// Unix seconds.
    pub(crate) expires: u64,
    /// What the token is called, to revoke it by: random.
    pub(crate) name: Id,
    /// The names of the owner's token that opened its room or call, and of the sender's token that it was made with;
    /// all zero where there is none.
    made_with: [Id; 2],
    /// The secret before signed it.
    is_by_previous: bool,
    /// Of a member: the seats of the call that one network address may have; 0 for as many as a call has where nothing
    /// else is said.
    seats_per_address: u8,
}

const NONE: Id = Id::from_bytes([0; 16]);

impl Claims {
    /// An owner's, in a token of a new name.
    pub(crate) fn owner(owner: Id, expires: u64) -> Result<Self, ServerError> {
        Self::in_room(Role::Owner, owner, Id::from_bytes([0; 16]), expires)
    }

    /// The same in a room: `role` is a sender's or a viewer's, or a member's, whose `room` is the call.
    pub(crate) fn in_room(
        role: Role,
        owner: Id,
        room: Id,
        expires: u64,
    ) -> Result<Self, ServerError> {
        Ok(Self {
            role,
            owner,
            room,
            expires,
            name: Id::random()?,
            made_with: [NONE; 2],
            is_by_previous: false,
            seats_per_address: 0,
        })
    }

    /// The same, made with the token of these claims: it is revoked with that one.
    pub(crate) fn made_with(self, other: &Self) -> Self {
        let [owners, _] = other.made_with;
        let made_with = if other.role == Role::Owner {
            [other.name, NONE]
        } else {
            [owners, other.name]
        };
        Self { made_with, ..self }
    }

    /// The token's name, and those of the tokens that it was made with: it holds while none of them is revoked.
    pub(crate) fn names(&self) -> impl Iterator<Item = Id> + use<> {
        let [owners, senders] = self.made_with;
        let made_with = [owners, senders].into_iter().filter(|name| *name != NONE);
        std::iter::once(self.name).chain(made_with)
    }

    /// The rooms that are the seats of a member's call, in their order.
    pub(crate) fn seats(&self, secret: &Secret) -> impl Iterator<Item = Id> + use<> {
        // A call that was opened before the secret was replaced keeps its seats.
        let key = secret.key(self.is_by_previous);
        let call = self.room;
        (0..MAX_PEOPLE).map(move |number| seat(&key, call, number))
    }

    /// The same for a call of which one network address may have so many seats.
    pub(crate) fn with_seats_per_address(self, seats: u8) -> Self {
        Self {
            seats_per_address: seats,
            ..self
        }
    }

    /// Of a member: the seats of the call that one network address may have.
    pub(crate) fn seats_per_address(&self) -> u8 {
        match self.seats_per_address {
            0 => SEATS_PER_ADDRESS,
            seats => seats,
        }
    }

    /// The room, or a member's call.
    pub(crate) fn room(&self) -> Id {
        self.room
    }

    /// Whether the bearer is one of `roles` in just this room.
    pub(crate) fn may(&self, roles: &[Role], room: Id) -> bool {
        self.role != Role::Owner && roles.contains(&self.role) && self.room == room
    }

    /// Whether the bearer is a member of the call of which this room is a seat.
    pub(crate) fn has_seat(&self, secret: &Secret, room: Id) -> bool {
        self.role == Role::Member && self.seats(secret).any(|seat| seat == room)
    }

    fn bytes(&self) -> Vec<u8> {
        let is_derived = self.made_with != [NONE; 2];
        let version = if is_derived { DERIVED_VERSION } else { VERSION };
        // The role has four bits, and so have the seats: both are 8 at most.
        let mut bytes = vec![version, self.role as u8 | self.seats_per_address << 4];
        bytes.extend(self.expires.to_le_bytes());
        bytes.extend(self.owner.as_bytes());
        bytes.extend(self.room.as_bytes());
        bytes.extend(self.name.as_bytes());
        if is_derived {
            bytes.extend(self.made_with.iter().flat_map(Id::as_bytes));
        }
        bytes
    }

    pub(crate) fn sign(&self, secret: &Secret) -> String {
        let mut token = self.bytes();
        let tag = mac(&secret.key(false), &token).finalize().into_bytes();
        token.extend_from_slice(&tag);
        URL_SAFE_NO_PAD.encode(token)
    }

    /// The content of `token`, if this secret signed it and `now` (Unix seconds) is before its end.
    pub(crate) fn verify(token: &str, secret: &Secret, now: u64) -> Option<Self> {
        Self::signed(token, secret).filter(|claims| now < claims.expires)
    }

    /// The content of `token`, if this secret or the one before signed it. The MAC is compared in a time that does not
    /// depend on where it differs, and before anything else is looked at.
    fn signed(token: &str, secret: &Secret) -> Option<Self> {
        let mut bytes = [0; DERIVED_CLAIMS_BYTES + MAC_BYTES];
        let length = URL_SAFE_NO_PAD.decode_slice(token, &mut bytes).ok()?;
        let claims_length = length.checked_sub(MAC_BYTES)?;
        let (claims, tag) = bytes.get(..length)?.split_at_checked(claims_length)?;
        let is_by = |key: &[u8; 32]| mac(key, claims).verify_slice(tag).is_ok();
        let is_by_previous = !is_by(&secret.key(false));
        if is_by_previous && !secret.previous().is_some_and(is_by) {
            return None;
        }
        let id = |at: usize| Some(Id::from_bytes(claims.get(at..at + 16)?.try_into().ok()?));
        let (version, role_and_seats) = (*claims.first()?, *claims.get(1)?);
        let made_with = match (version, claims.len()) {
            (VERSION, CLAIMS_BYTES) => [NONE; 2],
            (DERIVED_VERSION, DERIVED_CLAIMS_BYTES) => [id(58)?, id(74)?],
            _ => return None,
        };
        let role = match role_and_seats & 0xf {
            1 => Role::Owner,
            2 => Role::Sender,
            3 => Role::Viewer,
            4 => Role::Member,
            _ => return None,
        };
        Some(Self {
            role,
            expires: u64::from_le_bytes(claims.get(2..10)?.try_into().ok()?),
            owner: id(10)?,
            room: id(26)?,
            name: id(42)?,
            made_with,
            is_by_previous,
            seats_per_address: role_and_seats >> 4,
        })
    }
}

/// The room that is a call's seat of this number: neither the call nor another seat tells it.
fn seat(key: &[u8; 32], call: Id, number: usize) -> Id {
    let mut mac = mac_of(key, b"mon3tr seat\0");
    mac.update(call.as_bytes());
    mac.update(&(number as u64).to_le_bytes());
    let digest: [u8; MAC_BYTES] = mac.finalize().into_bytes().into();
    let mut seat = [0; 16];
    seat.copy_from_slice(&digest[..16]);
    Id::from_bytes(seat)
}

impl Secret {
    /// What the network of `address` is called in a room or a call: the same for one IPv4 address or one IPv6 /56, and
    /// another name in another room.
    pub(crate) fn network(&self, room: Id, address: IpAddr) -> Id {
        let mut mac = mac_of(&self.key(false), b"mon3tr network\0");
        mac.update(room.as_bytes());
        match network_prefix(address) {
            IpAddr::V4(address) => mac.update(&address.octets()),
            IpAddr::V6(address) => mac.update(&address.octets()),
        }
        let digest: [u8; MAC_BYTES] = mac.finalize().into_bytes().into();
        let mut network = [0; 16];
        network.copy_from_slice(&digest[..16]);
        Id::from_bytes(network)
    }

    /// A token with which the owner called `name` opens rooms and puts packages until `expires` (Unix seconds).
    ///
    /// # Errors
    /// If the system gives no random numbers.
    pub fn owner_token(&self, name: &str, expires: u64) -> Result<String, ServerError> {
        Ok(Claims::owner(Id::of_owner(name), expires)?.sign(self))
    }

    /// Whether this secret, and not the one before, signed `token`.
    #[must_use]
    pub fn has_signed(&self, token: &str) -> bool {
        Claims::signed(token, self).is_some_and(|claims| !claims.is_by_previous)
    }

    /// What `token` is called, to revoke it by, and when it expires (Unix seconds), if this secret or the one before
    /// signed it.
    pub fn look_at_token(&self, token: &str) -> Option<(Id, u64)> {
        Claims::signed(token, self).map(|claims| (claims.name, claims.expires))
    }
}

/// The key of TURN credentials: of one purpose only, so that it tells nothing of the secret, nor of tokens.
pub(crate) fn turn_key(secret: &Secret) -> turn_server::Key {
    turn_server::Key::new(
        mac_of(&secret.key(false), b"mon3tr turn\0")
            .finalize()
            .into_bytes()
            .into(),
    )
}

fn mac(key: &[u8; 32], claims: &[u8]) -> Hmac<Sha256> {
    let mut mac = mac_of(key, b"mon3tr token\0");
    mac.update(claims);
    mac
}

fn mac_of(secret: &[u8; 32], purpose: &[u8]) -> Hmac<Sha256> {
    // HMAC fills a key up to the hash's block with zeros; done here, there is no length to go wrong.
    let mut key = [0; 64];
    key[..32].copy_from_slice(secret);
    let mut mac = Hmac::<Sha256>::new(&key.into());
    mac.update(purpose);
    mac
}

/// Unix seconds.
pub fn now() -> u64 {
    SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .map_or(0, |since| since.as_secs())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_token_says_what_was_signed_until_it_expires() -> Result<(), Box<dyn std::error::Error>> {
        let secret = Secret::random()?;
        let (owner, room) = (Id::random()?, Id::random()?);
        let claims = Claims::in_room(Role::Viewer, owner, room, 1000)?;
        let token = claims.sign(&secret);
        assert_eq!(Claims::verify(&token, &secret, 999), Some(claims), "valid");
        assert_eq!(Claims::verify(&token, &secret, 1000), None, "expired");
        assert_eq!(
            Claims::verify(&token, &Secret::random()?, 999),
            None,
            "another secret's"
        );
        assert!(claims.may(&[Role::Viewer], room), "its room");
        assert!(!claims.may(&[Role::Viewer], Id::random()?), "another room");
        assert!(!claims.may(&[Role::Sender], room), "another role");
        let owner = Claims::owner(owner, 1000)?;
        assert!(
            !owner.may(&[Role::Owner, Role::Sender], Id::from_bytes([0; 16])),
            "an owner's token is no room's"
        );
        Ok(())
    }

    #[test]
    fn a_members_token_says_how_many_seats_an_address_may_have()
    -> Result<(), Box<dyn std::error::Error>> {
        let secret = Secret::random()?;
        let (owner, call) = (Id::random()?, Id::random()?);
        let member = Claims::in_room(Role::Member, owner, call, 1000)?;
        assert_eq!(member.seats_per_address(), 3, "nothing is said");
        for seats in 1..=8 {
            let token = member.with_seats_per_address(seats).sign(&secret);
            let read = Claims::verify(&token, &secret, 0).ok_or("genuine")?;
            assert_eq!((read.role, read.seats_per_address()), (Role::Member, seats));
        }
        Ok(())
    }

    #[test]
    fn a_network_has_one_name_in_one_room() -> Result<(), Box<dyn std::error::Error>> {
        let secret = Secret::random()?;
        let [room, other] = [Id::random()?, Id::random()?];
        let name = |room, address: &str| {
            let address = address.parse::<IpAddr>();
            address.map(|address| secret.network(room, address))
        };
        let same = [
            ("192.0.2.1", "::ffff:192.0.2.1"),
            ("2001:db8:0:1::1", "2001:db8:0:ff:ffff:ffff:ffff:ffff"),
        ];
        for (one, two) in same {
            assert_eq!(name(room, one)?, name(room, two)?, "{one} and {two}");
            assert_ne!(name(room, one)?, name(other, one)?, "of another room");
        }
        for (one, two) in [
            ("192.0.2.1", "192.0.2.2"),
            ("2001:db8:0:1::1", "2001:db8:0:100::1"),
        ] {
            assert_ne!(name(room, one)?, name(room, two)?, "{one} and {two}");
        }
        Ok(())
    }

    #[test]
    fn a_token_with_any_bit_changed_or_any_byte_missing_is_refused()
    -> Result<(), Box<dyn std::error::Error>> {
        let secret = Secret::random()?;
        let owner = Claims::owner(Id::of_owner("ada"), u64::MAX)?;
        let room = Claims::in_room(Role::Viewer, owner.owner, Id::random()?, u64::MAX)?;
        for token in [owner.sign(&secret), room.made_with(&owner).sign(&secret)] {
            no_change_is_taken(&secret, &token)?;
        }
        Ok(())
    }

    fn no_change_is_taken(secret: &Secret, token: &str) -> Result<(), Box<dyn std::error::Error>> {
        assert!(Claims::verify(token, secret, 0).is_some(), "unchanged");
        let bytes = URL_SAFE_NO_PAD.decode(token)?;
        for at in 0..bytes.len() * 8 {
            let mut changed = bytes.clone();
            changed[at / 8] ^= 1 << (at % 8);
            let changed = URL_SAFE_NO_PAD.encode(changed);
            assert_eq!(Claims::verify(&changed, secret, 0), None, "bit {at}");
        }
        for length in 0..bytes.len() {
            let short = URL_SAFE_NO_PAD.encode(&bytes[..length]);
            assert_eq!(Claims::verify(&short, secret, 0), None, "{length} bytes");
        }
        assert_eq!(
            Claims::verify(&format!("{token}AAAA"), secret, 0),
            None,
            "longer"
        );
        assert_eq!(
            Claims::verify(&format!("{token}="), secret, 0),
            None,
            "padded"
        );
        Ok(())
    }

    #[test]
    fn a_token_has_the_names_of_those_that_it_was_made_with()
    -> Result<(), Box<dyn std::error::Error>> {
        let secret = Secret::random()?;
        let (ada, room) = (Id::of_owner("ada"), Id::random()?);
        let owner = Claims::owner(ada, 1000)?;
        let sender = Claims::in_room(Role::Sender, ada, room, 1000)?.made_with(&owner);
        let guest = Claims::in_room(Role::Viewer, ada, room, 1000)?.made_with(&sender);
        let names = |claims: &Claims| {
            let read = Claims::verify(&claims.sign(&secret), &secret, 0).expect("genuine");
            assert_eq!(read, *claims);
            read.names().collect::<Vec<_>>()
        };
        assert_eq!(names(&owner), [owner.name]);
        assert_eq!(names(&sender), [sender.name, owner.name]);
        assert_eq!(names(&guest), [guest.name, owner.name, sender.name]);
        Ok(())
    }

    #[test]
    fn the_secret_before_holds_on_and_signs_nothing_new() -> Result<(), Box<dyn std::error::Error>>
    {
        let before = Secret::random()?;
        let replaced = Secret::random()?.after(&before);
        let call = Claims::in_room(Role::Member, Id::of_owner("ada"), Id::random()?, 1000)?;
        let token = call.sign(&before);
        let read = Claims::verify(&token, &replaced, 0).ok_or("refused")?;
        let seats = |claims: &Claims, secret| claims.seats(secret).collect::<Vec<_>>();
        assert_eq!(seats(&read, &replaced), seats(&call, &before), "its seats");
        assert!(!replaced.has_signed(&token) && before.has_signed(&token));
        let new = replaced.owner_token("ada", 1000)?;
        assert!(replaced.has_signed(&new));
        assert_eq!(Claims::verify(&new, &before, 0), None, "by the new one");
        let later = Secret::random()?.after(&replaced);
        assert_eq!(Claims::verify(&token, &later, 0), None, "two before");
        Ok(())
    }
}
