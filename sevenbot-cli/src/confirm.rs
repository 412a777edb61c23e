//! A question before something that cannot be taken back.

use std::io::{self, IsTerminal, Write};

use crate::command_error::CommandError;

/// Asks; goes on only after a yes. `yes` says that the user has answered already, with `--yes`. Where nobody
/// can answer, because standard input is no terminal, the question is the failure.
pub(crate) fn confirm(question: &str, yes: bool) -> Result<(), CommandError> {
    if yes {
        return Ok(());
    }
    if !io::stdin().is_terminal() {
        return Err(CommandError::Usage(format!("{question} Nobody is there to answer: --yes says yes")));
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
