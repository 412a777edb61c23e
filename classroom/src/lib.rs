//! A class: pupils with an arm each, a teacher who sees all of them, and perhaps one real arm that one pupil has at a time.
//!
//! ```text
//!   pupil's tab    ── FromPupil ───▶ ┌───────────┐ ◀── FromTeacher ── teacher's screen
//!                  ◀─ ToPupil ────── │ Classroom │ ─── ToTeacher ───▶
//!                                    └───────────┘
//!                          Hold, ArmNews │ ▲
//!                                        ▼ │
//!                                    the real arm
//! ```
//!
//! [`Classroom`] opens no port and reads no clock: messages and the time are arguments. `sevenbot-serve` connects it to WebSockets
//! and to the arm. The page in a browser uses the messages only. They are JSON: `docs/class.md` describes each.
//!
//! ```
//! use classroom::{ClassInfo, Classroom};
//! use protocol_core::time::{Duration, Instant};
//!
//! let now = Instant::ZERO;
//! let mut class = Classroom::new(ClassInfo::default());
//! let (mia, teacher) = (class.open_pupil(now, "a random key".to_owned()), class.open_teacher());
//! class.receive(now, mia, r#"{"join": {"name": "Mia", "key": null}}"#);
//! assert!(class.next_message(now, mia).is_some_and(|text| text.starts_with(r#"{"welcome":{"name":"Mia""#)));
//!
//! class.receive(now, teacher, r#""stop_all""#);
//! assert_eq!(class.next_message(now, mia).as_deref(), Some(r#"{"stop":{"number":1}}"#));
//! // The class repeats the stop until the tab reports that its arm holds or is limp.
//! let later = now + Duration::from_millis(100);
//! class.poll(later);
//! assert_eq!(class.next_message(later, mia).as_deref(), Some(r#"{"stop":{"number":1}}"#));
//! class.receive(later, mia, r#"{"stopped": {"number": 1, "outcome": "holds"}}"#);
//! ```

#![forbid(unsafe_code)]

mod connection;
mod desk;
mod for_pupil;
mod lease;
pub mod message;
pub mod name;
mod pupil;
mod real_arm;
mod room;
mod stop_all;

pub use connection::ConnectionId;
pub use message::{
    Doing, ExerciseProgress, FromPupil, FromTeacher, LeaseEnd, LentArm, StopOutcome, TabReport, ToPupil,
    ToTeacher,
};
pub use real_arm::ArmNews;
pub use room::{ClassInfo, Classroom, LeaseId, MOST_PUPILS};
