//! The command line tool.

mod basics;
mod calibrate;
mod fine;
mod formats;
mod lost_recordings;
mod map21;
mod monitor;
mod motion;
mod moving;
mod output;
mod position;
mod servo;
mod settings;
mod sim_port;
mod status;
mod stock_arm;
mod stream;
mod terminal;
mod wire;
