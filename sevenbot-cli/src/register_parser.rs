//! Arguments that name registers: any text that the library parses, and the names of the table for a shell's completion.

use std::ffi::OsStr;
use std::sync::LazyLock;

use clap::builder::{PossibleValue, TypedValueParser};
use clap::{Arg, Command, Error};
use sevenbot::map::MAP;
use sevenbot::names::{NameError, name_of};

/// Parses an argument with this function, and offers the names of the table to the shell's completion.
#[derive(Clone, Copy)]
pub(crate) struct RegisterParser<T>(pub(crate) fn(&str) -> Result<T, NameError>);

static NAMES: LazyLock<Vec<String>> = LazyLock::new(|| MAP.iter().map(name_of).collect());

impl<T: Clone + Send + Sync + 'static> TypedValueParser for RegisterParser<T> {
    type Value = T;

    fn parse_ref(&self, command: &Command, arg: Option<&Arg>, value: &OsStr) -> Result<T, Error> {
        TypedValueParser::parse_ref(&self.0, command, arg, value)
    }

    fn possible_values(&self) -> Option<Box<dyn Iterator<Item = PossibleValue> + '_>> {
        Some(Box::new(NAMES.iter().map(String::as_str).map(PossibleValue::new)))
    }
}
