//! Compares the secret that clients from other computers have to know.

/// Are both equal? The time of the comparison does not depend on how many bytes agree.
pub(crate) fn is_equal(one: &[u8], other: &[u8]) -> bool {
    let differences = one.iter().zip(other).fold(0, |bits, (one, other)| bits | (one ^ other));
    one.len() == other.len() && std::hint::black_box(differences) == 0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_same_bytes_are_equal() {
        assert!(is_equal(b"secret", b"secret"));
        for other in ["secre", "secrets", "Secret", ""] {
            assert!(!is_equal(b"secret", other.as_bytes()), "{other}");
        }
    }
}
