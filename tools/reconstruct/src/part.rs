//! What a face of the template belongs to.

/// The part of the person a face belongs to; it decides texture, density and sharpness.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[repr(u8)]
#[allow(missing_docs, reason = "the names say it")]
pub enum Part {
    /// Bare skin other than head and hands.
    Skin,
    /// The front of the head, mouth cavity included.
    Face,
    /// The rest of the head: ears, scalp, nape.
    Head,
    Hand,
    Jacket,
    Shirt,
    Jeans,
    Shoes,
    Hair,
    Brows,
    Lashes,
    Eyes,
    /// Teeth and gums.
    Teeth,
    Tongue,
}

impl Part {
    /// All parts.
    pub const ALL: [Self; 14] = [
        Self::Skin,
        Self::Face,
        Self::Head,
        Self::Hand,
        Self::Jacket,
        Self::Shirt,
        Self::Jeans,
        Self::Shoes,
        Self::Hair,
        Self::Brows,
        Self::Lashes,
        Self::Eyes,
        Self::Teeth,
        Self::Tongue,
    ];

    /// Position in [`Self::ALL`].
    #[must_use]
    pub const fn index(self) -> usize {
        self as usize
    }

    /// Whether this is woven cloth, which wrinkles.
    #[must_use]
    pub const fn is_cloth(self) -> bool {
        matches!(self, Self::Jacket | Self::Shirt | Self::Jeans)
    }
}
