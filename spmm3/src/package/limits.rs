//! How large a package may be, by whose it is.

/// What a package may hold. Checked against its directory and manifest before anything is unpacked.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PackageLimits {
    /// Gaussians.
    pub gaussians: usize,
    /// Bytes of the deform graph, of which a runtime makes several copies while it loads it.
    pub graph_bytes: u64,
    /// Bytes of all members, unpacked.
    pub bytes: u64,
}

impl PackageLimits {
    /// One's own packages: the format's own bounds hold, which reading keeps to.
    pub const OWN: Self = Self {
        gaussians: usize::MAX,
        graph_bytes: u64::MAX,
        bytes: u64::MAX,
    };

    /// Packages of the other people of a call, who are not known: the demo person has 40,079 Gaussians, a graph of 23 MB and 27 MB in all; one with 250,000
    /// Gaussians has a graph of 73 MB.
    pub const OTHERS: Self = Self {
        gaussians: 250_000,
        graph_bytes: 96 << 20,
        bytes: 192 << 20,
    };
}
