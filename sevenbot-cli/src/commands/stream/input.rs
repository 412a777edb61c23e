//! Set-points from standard input: parsing of the lines, and a thread that reads them.

use std::io::{self, BufRead};
use std::mem::replace;
use std::sync::mpsc::{Receiver, sync_channel};
use std::thread;
use std::time::Duration;

use serde::Deserialize;
use sevenbot::FineAngle;
use sevenbot::fine::FineTargets;

use crate::printer::warn;

/// The reading thread pauses while this many set-points wait in the channel.
const LINES_AHEAD: usize = 1_024;
/// Later times are refused, so that the arithmetic cannot overflow.
const LONGEST: Duration = Duration::from_secs(24 * 60 * 60);

/// Fields of a line: the time and seven angles.
const FIELDS: usize = 8;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct TimedPoint {
    pub(super) time: Duration,
    pub(super) joints: FineTargets,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct JsonLine {
    t: f64,
    joints: Vec<Option<f64>>,
}

/// Reads the set-points in a thread of its own. The channel ends with the input, or after the first error.
pub(super) fn read_in_background() -> Receiver<Result<TimedPoint, String>> {
    let (sender, receiver) = sync_channel(LINES_AHEAD);
    thread::spawn(move || {
        let mut lines = InputLines::default();
        for line in io::stdin().lock().lines() {
            let parsed = line.map_err(|error| error.to_string()).and_then(|line| lines.next(&line));
            let is_end = parsed.is_err();
            if let Some(item) = parsed.transpose()
                && (sender.send(item).is_err() || is_end)
            {
                return;
            }
        }
    });
    receiver
}

/// The state of the parser after the lines so far.
#[derive(Debug, Default)]
struct InputLines {
    number: usize,
    last: Option<Duration>,
    /// Has a line had the vacuum on?
    has_vacuum: bool,
}

impl InputLines {
    /// The set-point in the next line; `None` for an empty line and for the heading of a table: a first line with eight
    /// words.
    fn next(&mut self, line: &str) -> Result<Option<TimedPoint>, String> {
        self.number += 1;
        let line = self.without_vacuum(line.trim_start_matches('\u{feff}').trim());
        if line.is_empty() || (self.number == 1 && is_heading(line)) {
            return Ok(None);
        }
        let point = if line.starts_with('{') { json(line) } else { table(line) };
        let point = point.map_err(|reason| format!("line {}: {reason}", self.number))?;
        if let Some(last) = self.last.filter(|last| point.time <= *last) {
            let (time, last) = (point.time.as_secs_f64(), last.as_secs_f64());
            let reason = format!("the time {time} s is not later than {last} s, the one before");
            return Err(format!("line {}: {reason}", self.number));
        }
        self.last = Some(point.time);
        Ok(Some(point))
    }

    /// The line without the last column of a recording as CSV, the vacuum. Warns once if it is on.
    fn without_vacuum<'line>(&mut self, line: &'line str) -> &'line str {
        match line.rsplit_once(',') {
            Some((rest, vacuum))
                if !line.starts_with('{')
                    && rest.split(',').count() == FIELDS
                    && ["vacuum", "0", "1"].contains(&vacuum.trim()) =>
            {
                if vacuum.trim() == "1" && !replace(&mut self.has_vacuum, true) {
                    warn("a stream does not switch the vacuum pump: `sevenbot play` does");
                }
                rest
            }
            _ => line,
        }
    }
}

fn is_heading(line: &str) -> bool {
    let is_word = |field: &str| !field.trim().is_empty() && field.trim().parse::<f64>().is_err();
    line.split(',').count() == FIELDS && line.split(',').all(is_word)
}

fn json(line: &str) -> Result<TimedPoint, String> {
    let JsonLine { t, joints } = serde_json::from_str(line).map_err(|error| {
        // The line number of the parser is always 1.
        let error = error.to_string();
        let reason = error.split(" at line ").next().unwrap_or_default();
        format!("{reason}; a line is {{\"t\": SECONDS, \"joints\": [A1, A2, A3, A4, A5, A6, A7]}}")
    })?;
    let joints =
        joints.try_into().map_err(|joints: Vec<_>| format!("{} angles instead of 7", joints.len()))?;
    point(t, joints)
}

fn table(line: &str) -> Result<TimedPoint, String> {
    let fields: Vec<&str> = line.split(',').map(str::trim).collect();
    let [time, joints @ ..] = fields.as_slice() else { return Err(wrong_count(0)) };
    if joints.len() != 7 {
        return Err(wrong_count(fields.len()));
    }
    let number = |text: &str| text.parse::<f64>().map_err(|_| format!("`{text}` is not a number"));
    let mut angles = [None; 7];
    for (angle, text) in angles.iter_mut().zip(joints) {
        *angle = if text.is_empty() { None } else { Some(number(text)?) };
    }
    point(number(time)?, angles)
}

fn wrong_count(fields: usize) -> String {
    format!("{fields} fields instead of 8: seconds and seven angles")
}

fn point(seconds: f64, angles: [Option<f64>; 7]) -> Result<TimedPoint, String> {
    let time = Duration::try_from_secs_f64(seconds).ok().filter(|time| *time <= LONGEST);
    let time = time.ok_or_else(|| format!("{seconds} is not a time in seconds, up to a day"))?;
    let mut joints = [None; 7];
    for ((joint, degrees), number) in joints.iter_mut().zip(angles).zip(1..) {
        *joint = match degrees {
            None => None,
            Some(degrees) => Some(
                FineAngle::from_degrees(degrees)
                    .ok_or_else(|| format!("joint {number} cannot go to {degrees}°: it takes 0 to 180"))?,
            ),
        };
    }
    Ok(TimedPoint { time, joints })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Milliseconds and hundredths of a degree.
    type Numbers = (u128, [Option<u16>; 7]);

    fn parsed(text: &str) -> Result<Vec<Numbers>, String> {
        let mut lines = InputLines::default();
        let points = text.lines().filter_map(|line| lines.next(line).transpose());
        let hundredths = |point: TimedPoint| point.joints.map(|joint| joint.map(FineAngle::hundredths));
        points.map(|point| point.map(|point| (point.time.as_millis(), hundredths(point)))).collect()
    }

    #[test]
    fn json_and_tables_are_the_same_points() {
        let point = [Some(9_025), None, Some(6_500), Some(9_000), Some(9_000), Some(9_000), Some(8_001)];
        let json = "{\"t\": 0.02, \"joints\": [90.25, null, 65, 90, 90, 90, 80.0123]}\n";
        let table = "t,j1,j2,j3,j4,j5,j6,j7\n\n0.02, 90.25,,65,90,90,90,80.0123\n";
        assert_eq!(parsed(json), Ok(vec![(20, point)]));
        assert_eq!(parsed(table), Ok(vec![(20, point)]));
    }

    #[test]
    fn a_recording_as_csv_has_the_vacuum_after_the_angles() {
        let text = |vacuum| {
            let names = "seconds,joint_1,joint_2,joint_3,joint_4,joint_5,joint_6,joint_7,vacuum";
            format!("{names}\n0.000,90.00,90.00,65.00,90.00,90.00,90.00,80.00,{vacuum}\n")
        };
        for vacuum in ["0", "1"] {
            assert_eq!(parsed(&text(vacuum)).map(|points| points.len()), Ok(1));
        }
        assert_eq!(
            parsed(&text("80")),
            Err("line 2: 9 fields instead of 8: seconds and seven angles".to_owned())
        );
    }

    #[test]
    fn a_bad_first_line_is_no_heading() {
        for (line, says) in [
            ("abc", "line 1: 1 fields instead of 8"),
            ("t,j1", "line 1: 2 fields instead of 8"),
            ("NaN,90,90,65,90,90,90,80", "line 1: NaN is not a time"),
            ("t,90,90,65,90,90,90,80", "line 1: `t` is not a number"),
        ] {
            let refused = parsed(line).expect_err(line);
            assert!(refused.starts_with(says), "{refused}");
        }
    }

    #[test]
    fn a_bad_line_is_told_with_its_number() {
        let good = "0,90,90,65,90,90,90,80\n";
        let refused = |line: &str| parsed(&format!("{good}{line}\n")).expect_err("it is wrong");
        assert_eq!(refused("1,90,90"), "line 2: 3 fields instead of 8: seconds and seven angles");
        assert_eq!(refused("1,90,90,65,90,90,90,x"), "line 2: `x` is not a number");
        assert_eq!(
            refused("1,90,90,65,90,90,90,180.01"),
            "line 2: joint 7 cannot go to 180.01°: it takes 0 to 180"
        );
        assert_eq!(
            refused("0,90,90,65,90,90,90,80"),
            "line 2: the time 0 s is not later than 0 s, the one before"
        );
        assert!(refused("-1,90,90,65,90,90,90,80").contains("-1 is not a time"));
        assert!(refused("NaN,90,90,65,90,90,90,80").contains("is not a time"));
        assert!(refused("{\"t\": 1, \"joints\": [1, 2]}").starts_with("line 2: 2 angles instead of 7"));
        assert!(refused("{\"t\": 1}").contains("missing field `joints`; a line is {\"t\": SECONDS"));
        assert!(refused("t,j1,j2,j3,j4,j5,j6,j7").contains("not a number"), "a heading is the first line");
    }
}
