//! `completions`, `man`: what shells and manual readers want of the command line, written from itself.

use std::fs;
use std::path::{Path, PathBuf};

use clap::{Args, Command};
use clap_complete::Shell;
use clap_mangen::Man;

use crate::command_error::CommandError;
use crate::session::Session;

/// Print the completions for a shell.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  sevenbot completions bash > ~/.local/share/bash-completion/completions/sevenbot
  sevenbot completions zsh > ~/.zfunc/_sevenbot
  sevenbot completions fish > ~/.config/fish/completions/sevenbot.fish
  sevenbot completions powershell >> $PROFILE")]
pub(crate) struct CompletionsArgs {
    /// Which shell.
    shell: Shell,
}

/// Print a manual page.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  sevenbot man | man -l -                             this program
  sevenbot man pose | man -l -                        one command
  sevenbot man --dir ~/.local/share/man/man1          all of them, into files")]
pub(crate) struct ManArgs {
    /// The command; none: the program.
    command: Option<String>,
    /// Write the pages of the program and of all its commands into this folder.
    #[arg(long, value_name = "FOLDER", conflicts_with = "command")]
    dir: Option<PathBuf>,
}

pub(crate) fn completions(
    session: &mut Session,
    args: &CompletionsArgs,
    mut program: Command,
) -> Result<(), CommandError> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut program, "sevenbot", &mut script);
    session.printer.print_raw(&script)
}

pub(crate) fn man(session: &mut Session, args: &ManArgs, program: Command) -> Result<(), CommandError> {
    let mut program = program.disable_help_subcommand(true);
    // Gives every command what it inherits: the global options, and its full name.
    program.build();
    match (&args.dir, &args.command) {
        (Some(folder), _) => write_all(&program, folder),
        (None, Some(name)) => {
            let command = program.find_subcommand(name);
            let command =
                command.ok_or_else(|| CommandError::Usage(format!("there is no command {name}")))?;
            session.printer.print_raw(&page(command.clone())?)
        }
        (None, None) => session.printer.print_raw(&page(program)?),
    }
}

fn page(command: Command) -> Result<Vec<u8>, CommandError> {
    let mut page = Vec::new();
    let title = title(&command);
    Man::new(command).title(title).render(&mut page)?;
    Ok(page)
}

/// `sevenbot-pose` for `sevenbot pose`.
fn title(command: &Command) -> String {
    command.get_display_name().unwrap_or_else(|| command.get_name()).to_owned()
}

fn write_all(program: &Command, folder: &Path) -> Result<(), CommandError> {
    fs::create_dir_all(folder).map_err(|error| CommandError::file(folder, error))?;
    for command in std::iter::once(program).chain(program.get_subcommands()) {
        let path = folder.join(format!("{}.1", title(command)));
        fs::write(&path, page(command.clone())?).map_err(|error| CommandError::file(&path, error))?;
    }
    Ok(())
}
