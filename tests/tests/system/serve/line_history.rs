//! The last reads and replies on the arm's line, and the times of outages. A failed test prints them, to show why a reply is
//! missing.

use std::collections::VecDeque;
use std::sync::Mutex;
use std::time::{Duration, Instant};

use system_tests::relay::Passing;

/// The number of reads and replies that are kept: at least 12 s of them at 115 200 baud, if all are as short as possible.
const REMEMBERED: usize = 40_000;

/// The period that [`LineHistory::of_late`] counts.
const LATELY: Duration = Duration::from_secs(5);

#[derive(Clone, Copy)]
struct Read {
    at: Instant,
    is_reply: bool,
    address: u8,
    count: u8,
}

/// The reads and replies on the line, and the outages.
#[derive(Default)]
pub(crate) struct LineHistory {
    reads: Mutex<VecDeque<Read>>,
    /// Two times for each outage: when it began, and when the arm answered again.
    turns: Mutex<Vec<Instant>>,
}

impl LineHistory {
    pub(crate) fn turn_over(&self) {
        self.turns.lock().expect("no panic").push(Instant::now());
    }

    pub(crate) fn note(&self, passing: Passing<'_>) {
        let (Passing::Request(frame) | Passing::Reply(frame)) = passing;
        let &[_, _, 3, address, count, ..] = frame else { return };
        let mut reads = self.reads.lock().expect("no panic");
        if reads.len() == REMEMBERED {
            reads.pop_front();
        }
        let is_reply = matches!(passing, Passing::Reply(_));
        reads.push_back(Read { at: Instant::now(), is_reply, address, count });
    }

    /// The numbers of reads and replies in [`LATELY`], and the age of the last one of each.
    pub(crate) fn of_late(&self) -> String {
        let reads = self.reads.lock().expect("no panic");
        let of_kind = |is_reply: bool| {
            let ages =
                reads.iter().rev().filter(|read| read.is_reply == is_reply).map(|read| read.at.elapsed());
            let (count, last) = (ages.clone().take_while(|&age| age < LATELY).count(), ages.clone().next());
            format!("{count} in {LATELY:?}, the last one {last:?} ago")
        };
        format!("reads on the line: {}, replies: {}", of_kind(false), of_kind(true))
    }

    /// Describes what the line carried for a read of these registers that was sent at this time.
    pub(crate) fn told(&self, sent: Instant, (address, count): (u8, u8)) -> String {
        let since = |at: Instant| match at.checked_duration_since(sent) {
            Some(after) => after.as_secs_f64(),
            None => -(sent - at).as_secs_f64(),
        };
        let turns = self.turns.lock().expect("no panic");
        let turns: Vec<String> = turns.iter().rev().take(3).map(|&at| format!("{:+.3}", since(at))).collect();
        let reads = self.reads.lock().expect("no panic");
        let end = |address: u8, count: u8| u16::from(address) + u16::from(count);
        // The server asks for a few registers more while a read of the same range is pending, so that replies can be told apart.
        let of_it = reads.iter().filter(|read| {
            let is_near = read.at >= sent && since(read.at) < 40.0 && read.count <= count + 2;
            is_near && read.address <= address && end(read.address, read.count) >= end(address, count)
        });
        let on_line: Vec<String> = of_it
            .take(6)
            .map(|read| {
                let kind = if read.is_reply { "reply" } else { "read" };
                format!("{kind} {}+{} at {:+.3}", read.address, read.count, since(read.at))
            })
            .collect();
        format!(
            "{address}+{count}; turns of outages at {turns:?} s from its sending; on the line: {on_line:?}"
        )
    }
}
