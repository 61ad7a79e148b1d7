//! The signing block: signatures of both schemes, between the zip's members and its directory.

use super::signer::Signer;
use crate::ApkError;

const V2: u32 = 0x7109_871a;
const V3: u32 = 0xf053_68c0;
const PADDING: u32 = 0x4272_6577;
/// In a v2 signature: that there is a v3 one too, so that nobody can take it out unseen.
const STRIPPING_PROTECTION: u32 = 0xbeef_f00d;
const MAGIC: &[u8; 16] = b"APK Sig Block 42";
/// Android 9, the first that reads v3, and no last one.
const V3_SDKS: [u32; 2] = [28, i32::MAX as u32];
/// Blocks fill pages, as those of Android's own tool.
const PAGE: usize = 4096;

/// The whole block, for contents of this digest.
pub(super) fn signing_block(signer: &Signer, digest: &[u8]) -> Result<Vec<u8>, ApkError> {
    let mut pairs = [
        pair(V2, &v2(signer, digest)?),
        pair(V3, &v3(signer, digest)?),
    ]
    .concat();
    // The block's size twice, the magic, and the padding's own size and number.
    let rest = pairs.len() + 8 + 8 + MAGIC.len() + 12;
    pairs.extend(pair(PADDING, &vec![0; rest.next_multiple_of(PAGE) - rest]));
    let size = (pairs.len() + 8 + MAGIC.len()) as u64;
    Ok([
        &size.to_le_bytes(),
        pairs.as_slice(),
        &size.to_le_bytes(),
        MAGIC,
    ]
    .concat())
}

fn v2(signer: &Signer, digest: &[u8]) -> Result<Vec<u8>, ApkError> {
    let protection = sized(&[STRIPPING_PROTECTION.to_le_bytes(), 3_u32.to_le_bytes()].concat());
    let signed = [
        digests(signer, digest),
        certificates(signer),
        sized(&protection),
        sized(&[]),
    ]
    .concat();
    let parts = [
        sized(&signed),
        signatures(signer, &signed)?,
        sized(signer.public_key()),
    ];
    Ok(sized(&sized(&parts.concat())))
}

fn v3(signer: &Signer, digest: &[u8]) -> Result<Vec<u8>, ApkError> {
    let sdks: Vec<u8> = V3_SDKS.into_iter().flat_map(u32::to_le_bytes).collect();
    let signed = [
        digests(signer, digest),
        certificates(signer),
        sdks.clone(),
        sized(&[]),
    ]
    .concat();
    let parts = [
        sized(&signed),
        sdks,
        signatures(signer, &signed)?,
        sized(signer.public_key()),
    ];
    Ok(sized(&sized(&parts.concat())))
}

fn digests(signer: &Signer, digest: &[u8]) -> Vec<u8> {
    sized(&sized(
        &[&signer.algorithm().to_le_bytes(), sized(digest).as_slice()].concat(),
    ))
}

fn certificates(signer: &Signer) -> Vec<u8> {
    sized(
        &signer
            .certificates()
            .iter()
            .flat_map(|one| sized(one))
            .collect::<Vec<u8>>(),
    )
}

fn signatures(signer: &Signer, signed: &[u8]) -> Result<Vec<u8>, ApkError> {
    let signature = signer.sign(signed)?;
    Ok(sized(&sized(
        &[
            &signer.algorithm().to_le_bytes(),
            sized(&signature).as_slice(),
        ]
        .concat(),
    )))
}

/// The bytes behind their count. Keys and certificates are kilobytes.
fn sized(bytes: &[u8]) -> Vec<u8> {
    [&crate::chunk::size(bytes.len()).to_le_bytes(), bytes].concat()
}

/// A member of the block: size, number, value.
fn pair(number: u32, value: &[u8]) -> Vec<u8> {
    [
        &(value.len() as u64 + 4).to_le_bytes()[..],
        &number.to_le_bytes(),
        value,
    ]
    .concat()
}
