//! A program that uses the maker's WebSocket: a page, which gets an answer to each command, or the maker's Python client.

use std::io;
use std::thread::sleep;
use std::time::Duration;

use serde_json::{Value, json};
use system_tests::random::Random;

use super::visit::Visit;
use super::visitor::{Answer, Chaos, Tally};
use super::wire::WebWire;
use crate::serve::served::web_frame;

/// One connection.
pub(super) struct WebVisit<'a> {
    chaos: &'a Chaos,
    wire: WebWire,
    is_page: bool,
    /// Answers to commands that the page has not read yet.
    unread: usize,
}

impl<'a> WebVisit<'a> {
    /// `None` if the server accepts no connection.
    pub(super) fn open(chaos: &'a Chaos, address: &str, is_page: bool) -> Option<Self> {
        let wire = WebWire::open(address, is_page, &chaos.security).ok()?;
        Some(Self { chaos, wire, is_page, unread: 0 })
    }

    fn command(&mut self, command: &Value) -> io::Result<()> {
        self.unread += usize::from(self.is_page);
        self.wire.send(&command.to_string())
    }

    fn target(&mut self) -> io::Result<()> {
        self.unread += usize::from(self.is_page);
        let wire = &mut self.wire;
        self.chaos.targets.send(|[a, b, c, d]| {
            wire.send(&json!({ "cmd": "angles", "angles": [a, b, c, d, 90, 90, 80] }).to_string())
        })
    }
}

impl Visit for WebVisit<'_> {
    fn chaos(&self) -> &Chaos {
        self.chaos
    }

    fn ask(&mut self, own: Option<u8>, random: &mut Random) -> io::Result<Answer> {
        let value = 1 + random.below(100);
        let (address, count) = own.map_or_else(|| self.chaos.question(), |own| (own, 1));
        let wait = self.chaos.wait((address, count));
        if let Some(own) = own {
            let write = json!({ "cmd": "write", "id": own, "num": 1, "value": [value] });
            self.command(&write)?;
        }
        self.wire.send(&json!({ "cmd": "read", "id": address, "num": count }).to_string())?;
        loop {
            match self.wire.receive()? {
                Some(_) if self.unread > 0 => self.unread -= 1,
                Some(text) => {
                    let answer: Value = serde_json::from_str(&text).unwrap_or_default();
                    let values = answer["data"].as_array().map_or(0, Vec::len);
                    let is_own = own.is_none() || answer["data"] == json!([value]);
                    if values == usize::from(count) && is_own {
                        return Ok(Answer::Replied);
                    }
                    if (answer["status"] == "error" || own.is_some()) && wait.may_be_cut() {
                        return Ok(Answer::Cut);
                    }
                    if answer["status"] == "error" {
                        println!("{text}");
                        return Ok(wait.lost());
                    }
                    println!("crossed: {text} instead of {count} values from {address} on, {value}");
                    return Ok(Answer::Crossed);
                }
                None => {}
            }
            if let Some(answer) = wait.ended() {
                return Ok(answer);
            }
        }
    }

    fn act(&mut self, random: &mut Random) -> io::Result<()> {
        match random.below(6) {
            0..=2 => {
                for _ in 0..1 + random.below(10) {
                    self.target()?;
                }
                Ok(())
            }
            3 => self.command(&json!({ "cmd": "stop" })),
            4 => self.command(&json!({ "cmd": "ping" })),
            _ => {
                sleep(Duration::from_millis(random.below(400)));
                Ok(())
            }
        }
    }

    fn leave(mut self, random: &mut Random, tally: &mut Tally) {
        match random.below(5) {
            0 => {
                for _ in 0..20 {
                    let _ = self.wire.send(r#"{"cmd":"read","id":0,"num":255}"#);
                }
                sleep(Duration::from_millis(random.below(1_000)));
            }
            // A message without an end.
            1 => drop(self.wire.send_bytes(&web_frame(0x01, b"{"))),
            2 => {
                for _ in 0..random.below(100) {
                    if self.target().is_err() {
                        break;
                    }
                }
            }
            _ => {}
        }
        if random.below(2) == 0 {
            tally.resets += 1;
            self.wire.reset();
        } else {
            self.wire.close();
        }
    }
}
