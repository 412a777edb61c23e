//! The whole arm in a world where everything goes wrong, again and again.

pub mod load;
