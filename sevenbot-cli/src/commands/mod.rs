//! The commands: arguments and execution. Related commands share a module.

pub(crate) mod backup;
pub(crate) mod baud;
pub(crate) mod calibrate;
pub(crate) mod class;
pub(crate) mod convert;
pub(crate) mod effector;
pub(crate) mod get;
pub(crate) mod info;
pub(crate) mod log;
pub(crate) mod model;
pub(crate) mod monitor;
pub(crate) mod move_to;
pub(crate) mod park;
pub(crate) mod play;
pub(crate) mod plot;
pub(crate) mod ports;
pub(crate) mod pose;
pub(crate) mod position;
pub(crate) mod record;
pub(crate) mod recover;
pub(crate) mod registers;
pub(crate) mod serve;
pub(crate) mod servo;
pub(crate) mod set;
pub(crate) mod shell;
#[cfg(unix)]
pub(crate) mod sim;
pub(crate) mod sniff;
pub(crate) mod state;
pub(crate) mod status;
pub(crate) mod stop;
pub(crate) mod stream;
pub(crate) mod view;
