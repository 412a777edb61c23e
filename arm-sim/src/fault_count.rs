//! How often a fault took effect.

/// How often a fault took effect, and how often it could have.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct FaultCount {
    /// How often it took effect; never more than `occasions`.
    pub effects: u64,
    /// How often it could have taken effect. The kind of the fault determines the unit.
    pub occasions: u64,
}

impl FaultCount {
    pub(crate) const fn count(&mut self, has_effect: bool) {
        self.count_many(1, has_effect);
    }

    /// Counts several occasions. With `has_effect`, the fault took effect in each of them, otherwise in none.
    pub(crate) const fn count_many(&mut self, occasions: u64, has_effect: bool) {
        self.occasions = self.occasions.saturating_add(occasions);
        if has_effect {
            self.effects = self.effects.saturating_add(occasions);
        }
    }

    #[must_use]
    pub(crate) const fn plus(self, other: Self) -> Self {
        Self {
            effects: self.effects.saturating_add(other.effects),
            occasions: self.occasions.saturating_add(other.occasions),
        }
    }
}
