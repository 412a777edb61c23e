//! `completions`, `man`: shell completions and manual pages, generated from the command line.

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
  sevenbot completions bash \\
      > ~/.local/share/bash-completion/completions/sevenbot
  sevenbot completions zsh > ~/.zfunc/_sevenbot
  sevenbot completions fish > ~/.config/fish/completions/sevenbot.fish
  sevenbot completions powershell >> $PROFILE")]
pub(crate) struct CompletionsArgs {
    /// The shell.
    shell: Shell,
}

/// Print a manual page.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  sevenbot man | man -l -                             this program
  sevenbot man servo scan | man -l -                  one command
  sevenbot man --dir ~/.local/share/man/man1          all of them, into files")]
pub(crate) struct ManArgs {
    /// The command, such as `pose` or `servo scan`; none: the program.
    command: Vec<String>,
    /// Write the pages of the program and of all commands to this folder.
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
    // Adds the global options and the full name to each command.
    program.build();
    if let Some(folder) = &args.dir {
        fs::create_dir_all(folder).map_err(|error| CommandError::file(folder, error))?;
        return write_pages(&program, folder);
    }
    let mut command = &program;
    for name in &args.command {
        let found = command.find_subcommand(name);
        command = found.ok_or_else(|| CommandError::Usage(format!("there is no command {name}")))?;
    }
    session.printer.print_raw(&page(command.clone())?)
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

/// Writes the pages of a command and of all its subcommands.
fn write_pages(command: &Command, folder: &Path) -> Result<(), CommandError> {
    let path = folder.join(format!("{}.1", title(command)));
    fs::write(&path, page(command.clone())?).map_err(|error| CommandError::file(&path, error))?;
    command.get_subcommands().try_for_each(|subcommand| write_pages(subcommand, folder))
}
