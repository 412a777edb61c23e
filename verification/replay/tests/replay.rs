//! A replay of a recorded session is equal byte for byte, or returns the first difference. Other texts are refused.

#![allow(clippy::unwrap_used)] // A panic is a failed test.

use arm_sim::replay::{Replay, ReplayError};
use arm_sim::session::{HeaderError, SessionHeader};
use replay::random_session::random_session;
use replay::{equal_replays, session_checksum};

#[test]
fn every_replay_of_a_random_session_is_equal() {
    let mut bytes = 0;
    for seed in 0..200 {
        let session = random_session(seed);
        bytes += session.len();
        if let Err(error) = Replay::run(&session) {
            panic!("seed {seed}: {error}");
        }
    }
    assert!(bytes > 200 * 2_000, "{bytes}");
}

#[test]
fn the_same_seed_gives_the_same_session() {
    assert_eq!(random_session(7), random_session(7));
    assert_ne!(session_checksum(7), session_checksum(8));
    assert_eq!(equal_replays(7, 3), 3);
}

#[test]
fn the_first_difference_is_told() {
    let session = random_session(1);
    let line = session.lines().position(|line| line.contains(" < ")).unwrap();
    let changed: Vec<String> = session
        .lines()
        .enumerate()
        .map(
            |(number, text)| {
                if number == line { text.replacen("< aa77", "< aa78", 1) } else { text.to_owned() }
            },
        )
        .collect();
    let error = Replay::run(&changed.join("\n")).unwrap_err();
    assert!(matches!(error, ReplayError::Different { line: at, .. } if at == line + 1), "{error}");
    let text = error.to_string();
    assert!(text.contains("'aa77") && text.contains("'aa78") && text.contains("byte 2 differs"), "{text}");
}

#[test]
fn what_is_no_session_is_refused() {
    let header = SessionHeader::default().to_string();
    assert_eq!(Replay::run(&header), Ok(2));
    assert_eq!(Replay::run(""), Err(HeaderError::NoSession.into()));
    assert_eq!(Replay::run("7bot-session 2"), Err(HeaderError::NoSession.into()));
    assert_eq!(Replay::run(&header.replace("seed=1", "seed=x")), Err(HeaderError::Value("seed").into()));
    for line in ["5", "5 >", "x ~", "5 > zz", "5 ! jump", "5 ? 00"] {
        let error = Replay::run(&format!("{header}\n{line}")).unwrap_err();
        assert!(matches!(error, ReplayError::Line { line: 3, .. }), "{line}: {error}");
    }
    assert_eq!(Replay::run(&format!("{header}\n5 ~\n4 ~")), Err(ReplayError::Backwards { line: 4 }));
}
