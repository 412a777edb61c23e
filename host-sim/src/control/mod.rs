//! The control socket of an arm: faults, a hand, things, power, virtual time, snapshots and state, while the simulator runs.
//!
//! ```text
//!   client ──▶ {"do":"fault","fault":"3=missing","for_ms":2000}
//!          ◀── {"ok":{"fault":"3=missing","replaced":[]}}
//!   client ──▶ {"do":"state"}
//!          ◀── {"ok":{"time_us":8250000,"joints":[...],"faults":[...],...}}
//!   client ──▶ {"do":"stat"}
//!          ◀── {"error":"unknown variant `stat`, ...","hint":"a request is one JSON object in a line, ..."}
//! ```
//!
//! A request is one line with a JSON object, and so is its answer. Answers have the order of the requests.

pub mod execute;
pub mod path;
pub mod request;
pub mod socket;
pub mod state;
