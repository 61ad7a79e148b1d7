//! What people show to prove who they are.

use identity::{Identity, KeyHash, Permit, PublicKey, Purpose, Signature};

/// Keys, signatures and permits as texts. What is read is written as it was, and nothing but what was signed is taken for it.
pub(crate) fn keys(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else {
        return;
    };
    if let Ok(key) = text.parse::<PublicKey>() {
        let again = key.to_string().parse::<PublicKey>().ok();
        assert_eq!(again, Some(key), "as it was written");
    }
    if let Ok(hash) = text.parse::<KeyHash>() {
        let again = hash.to_string().parse::<KeyHash>().ok();
        assert_eq!(again, Some(hash), "as it was written");
    }
    if let Ok(signature) = text.parse::<Signature>() {
        let again = signature.to_string().parse::<Signature>();
        assert!(
            again.is_ok_and(|again| again == signature),
            "as it was written"
        );
    }
    // Only who has a key of another one's makes these.
    if let Ok(permit) = text.parse::<Permit>()
        && permit.check(0).is_ok()
    {
        assert_eq!(permit.owner(), owner().public(), "nobody else signed one");
    }
    if let Ok(key) = PublicKey::of_signed(text, Purpose::Sender, SIGNED) {
        assert_eq!(key, owner().public(), "nobody else signed it");
    }
}

const SIGNED: &[u8] = b"what was signed";

fn owner() -> Identity {
    Identity::from_seed(&[7; 32]).expect("a key")
}

pub(crate) fn key_seeds() -> Vec<Vec<u8>> {
    let owner = owner();
    [
        owner.public().to_string(),
        owner.public().hash().to_string(),
        owner.sign(Purpose::Sender, SIGNED).to_string(),
        owner.sign_as_text(Purpose::Sender, SIGNED),
        Permit::new(&owner, owner.public(), 2_000_000_000).to_string(),
    ]
    .map(String::into_bytes)
    .into()
}
