//! Asks the user for confirmation before an action.

use std::io::{self, IsTerminal, Write};

use crate::command_error::CommandError;

/// Asks the question and fails unless the answer is yes. Does not ask if `yes` is true (`--yes` was given). Otherwise it also
/// fails if standard input is not a terminal.
pub(crate) fn confirm(question: &str, yes: bool) -> Result<(), CommandError> {
    if yes {
        return Ok(());
    }
    if !io::stdin().is_terminal() {
        return Err(CommandError::Usage(format!(
            "{question} Standard input is no terminal: use --yes to confirm"
        )));
    }
    let mut err = anstream::stderr();
    write!(err, "{question} [y/N] ")?;
    err.flush()?;
    let mut answer = String::new();
    io::stdin().read_line(&mut answer)?;
    if matches!(answer.trim().to_ascii_lowercase().as_str(), "y" | "yes") {
        Ok(())
    } else {
        Err(CommandError::Arm("nothing was done".to_owned()))
    }
}
