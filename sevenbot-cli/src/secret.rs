//! Random secrets.

use crate::command_error::CommandError;

/// Letters and digits of a class code, without those that look alike on a board: 0 and o, 1 and l.
const CODE_LETTERS: &[u8; 32] = b"abcdefghijkmnpqrstuvwxyz23456789";
/// The length of a class code, in characters: 30 random bits. After a wrong code the server delays the next try.
const CODE_LENGTH: usize = 6;

fn random<const N: usize>() -> Option<[u8; N]> {
    let mut bytes = [0; N];
    getrandom::fill(&mut bytes).ok().map(|()| bytes)
}

/// 128 random bits in hexadecimal; `None` if the operating system has no random numbers.
pub(crate) fn key() -> Option<String> {
    let bytes: [u8; 16] = random()?;
    Some(bytes.iter().map(|byte| format!("{byte:02x}")).collect())
}

/// 128 random bits in hexadecimal.
pub(crate) fn new_secret() -> Result<String, CommandError> {
    key().ok_or_else(no_random_numbers)
}

/// A code that pupils type.
pub(crate) fn new_class_code() -> Result<String, CommandError> {
    let bytes: [u8; CODE_LENGTH] = random().ok_or_else(no_random_numbers)?;
    let letter = |byte: u8| CODE_LETTERS.get(usize::from(byte % 32)).copied().map(char::from);
    Ok(bytes.into_iter().filter_map(letter).collect())
}

fn no_random_numbers() -> CommandError {
    CommandError::Arm("the operating system has no random numbers".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_secret_is_another_one() {
        let secrets = [new_secret(), new_secret()].map(|secret| secret.expect("a secret"));
        assert!(secrets.iter().all(|secret| secret.len() == 32));
        assert_ne!(secrets[0], secrets[1]);
        let codes = [new_class_code(), new_class_code()].map(|code| code.expect("a code"));
        assert!(codes.iter().all(|code| code.len() == CODE_LENGTH && code.is_ascii()));
        assert_ne!(codes[0], codes[1]);
    }
}
