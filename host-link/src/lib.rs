//! The host's end of the link to an arm: frames its requests, matches the replies, and knows when a reply is lost.
//!
//! ```text
//!   read, write ──▶ queue ──▶ Send(bytes) ──▶ arm
//!                     │ each sent read
//!                     ▼
//!                PendingReads ── matched in order (D5) ──▶ Reply, NoReply
//!                     ▲
//!   bytes ──▶ Deframer ┴──────────────────────────────────▶ Report, Alarm, Unmatched, Damaged
//! ```
//!
//! The crate reads no clock and opens no port: time and bytes are arguments. The blocking library, the hub of
//! `sevenbot serve` and the page in a browser are shells round it. It does not know what the registers of the arm mean,
//! except for three things that its shells share: the layout versions of their blocks ([`Snapshot`]), the registers of a
//! server ([`sharing`]), and the limits that a stop has to keep ([`keep_limits`]).
//!
//! ```
//! use host_link::{HostEvent, HostLink, LinkOptions, Patience, Span};
//! use protocol_core::time::{Duration, Instant};
//!
//! let mut link = HostLink::new(LinkOptions { baud: 115_200, reports: &[] });
//! let positions = Span::new(54, 7).ok_or("a span")?;
//! let id = link.read(positions, Patience { attempts: 3, timeout: Duration::from_millis(500) });
//! let now = Instant::from_micros(0);
//! let HostEvent::Send(request) = link.poll(now) else { return Err("a frame") };
//! assert_eq!(request, [0xAA, 0x77, 0x03, 54, 7, 0x81, 0xCE]);
//!
//! // The shell sends the frame, waits until the time of `Wait`, and passes on what it received.
//! assert!(matches!(link.poll(now), HostEvent::Wait(_)));
//! let reply = [0xAA, 0x77, 3, 54, 7, 90, 90, 65, 90, 90, 90, 80, 0x43, 0x81];
//! let now = Instant::from_micros(2_000);
//! link.bytes(now, &reply);
//! let HostEvent::Reply(replied, values) = link.poll(now) else { return Err("a reply") };
//! assert_eq!((replied, values.at(56)), (id, 65));
//! # Ok::<(), &str>(())
//! ```

#![forbid(unsafe_code)]

mod event;
mod limits;
mod line_time;
mod link;
mod open_reads;
mod pending_reads;
pub mod sharing;
mod snapshot;
mod span;

pub use event::{HostEvent, RequestId};
pub use limits::keep_limits;
pub use line_time::{ROUND_TRIP, time_on_line};
pub use link::{HostLink, LinkOptions};
pub use open_reads::Patience;
pub use snapshot::Snapshot;
pub use span::Span;
