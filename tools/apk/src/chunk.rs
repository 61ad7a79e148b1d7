//! The chunks that Android's binary XML and resource tables are made of (`ResChunk_header`): type, size of the header, size of all.

/// Chunk types (`frameworks/base/libs/androidfw/include/androidfw/ResourceTypes.h`).
pub(crate) mod kind {
    pub(crate) const STRING_POOL: u16 = 0x0001;
    pub(crate) const TABLE: u16 = 0x0002;
    pub(crate) const XML: u16 = 0x0003;
    pub(crate) const XML_START_NAMESPACE: u16 = 0x0100;
    pub(crate) const XML_END_NAMESPACE: u16 = 0x0101;
    pub(crate) const XML_START_ELEMENT: u16 = 0x0102;
    pub(crate) const XML_END_ELEMENT: u16 = 0x0103;
    pub(crate) const XML_RESOURCE_MAP: u16 = 0x0180;
    pub(crate) const TABLE_PACKAGE: u16 = 0x0200;
    pub(crate) const TABLE_TYPE: u16 = 0x0201;
    pub(crate) const TABLE_TYPE_SPEC: u16 = 0x0202;
}

/// What comes before the type's own part of a header.
pub(crate) const HEADER: usize = 8;

/// A chunk of `kind`: `header` is the type's own part of the header.
pub(crate) fn chunk(kind: u16, header: &[u8], body: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(HEADER + header.len() + body.len());
    bytes.extend(kind.to_le_bytes());
    bytes.extend(short(HEADER + header.len()).to_le_bytes());
    bytes.extend(size(HEADER + header.len() + body.len()).to_le_bytes());
    bytes.extend(header);
    bytes.extend(body);
    bytes
}

/// The words, little-endian.
pub(crate) fn words(words: impl IntoIterator<Item = u32>) -> Vec<u8> {
    words.into_iter().flat_map(u32::to_le_bytes).collect()
}

/// A count, offset or size as the format stores it.
pub(crate) fn size(value: usize) -> u32 {
    u32::try_from(value)
        .expect("texts are bounded (`small::MAX_BYTES`), far below what 32 bits count")
}

/// A header's size, or a count that was checked before.
pub(crate) fn short(value: usize) -> u16 {
    u16::try_from(value)
        .expect("headers are short, and counts of 16 bits are checked where they come from")
}
