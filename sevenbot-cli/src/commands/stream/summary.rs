//! The output of `stream` at its end.

use std::io::{self, Write};
use std::time::Duration;

use serde::Serialize;
use sevenbot::stream::PaceCounts;

use super::tracking::TrackingError;
use crate::printer::Printable;

#[derive(Debug, Serialize)]
pub(super) struct StreamSummary {
    points: u32,
    period_ms: u64,
    /// Points later than a quarter of the period, points passed over, and pauses of the input.
    late_points: u32,
    largest_gap_ms: f64,
    jitter_ms: f64,
    /// Frames that the arm refused meanwhile, by its counter in registers 250 and 251.
    refused: u16,
    #[serde(skip_serializing_if = "Option::is_none")]
    tracking: Option<TrackingJson>,
}

#[derive(Debug, Serialize)]
struct TrackingJson {
    rms_degrees: f64,
    largest_degrees: f64,
    joint: u8,
}

impl StreamSummary {
    pub(super) fn new(
        counts: PaceCounts,
        period: Duration,
        refused: u16,
        tracking: Option<TrackingError>,
    ) -> Self {
        let millis = |time: Duration| (time.as_secs_f64() * 1e5).round() / 100.0;
        let hundredths = |number: f64| (number * 100.0).round() / 100.0;
        Self {
            points: counts.points,
            period_ms: u64::try_from(period.as_millis()).unwrap_or(u64::MAX),
            late_points: counts.late,
            largest_gap_ms: millis(counts.largest_gap),
            jitter_ms: millis(counts.jitter()),
            refused,
            tracking: tracking.map(|TrackingError { rms, largest, joint }| TrackingJson {
                rms_degrees: hundredths(rms),
                largest_degrees: hundredths(largest),
                joint,
            }),
        }
    }
}

impl Printable for StreamSummary {
    fn write_text(&self, out: &mut dyn Write) -> io::Result<()> {
        let Self { points, period_ms, late_points, largest_gap_ms, jitter_ms, refused, tracking } = self;
        writeln!(out, "sent      {points} points, one each {period_ms} ms")?;
        writeln!(
            out,
            "late      {late_points} points; largest gap {largest_gap_ms:.1} ms, jitter {jitter_ms:.2} ms"
        )?;
        if *refused > 0 {
            writeln!(out, "refused   {refused} points; `sevenbot info` shows the reason")?;
        }
        let Some(TrackingJson { rms_degrees, largest_degrees, joint }) = tracking else { return Ok(()) };
        writeln!(out, "tracking  {rms_degrees:.2}° off (rms), {largest_degrees:.2}° at most, joint {joint}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sevenbot::stream::StreamPace;

    #[test]
    fn lateness_roughness_and_error_are_told() {
        let (start, period) = (Duration::from_secs(1), Duration::from_millis(20));
        let mut pace = StreamPace::new(start, period);
        for millis in [0, 20, 46] {
            pace.take(start + Duration::from_millis(millis));
        }
        let error = TrackingError { rms: 0.204, largest: 1.5, joint: 2 };
        let summary = StreamSummary::new(pace.counts(), period, 1, Some(error));
        let mut text = Vec::new();
        summary.write_text(&mut text).expect("memory");
        assert_eq!(
            String::from_utf8(text).expect("text"),
            "sent      3 points, one each 20 ms\nlate      1 points; largest gap 26.0 ms, jitter 2.83 ms\n\
             refused   1 points; `sevenbot info` shows the reason\n\
             tracking  0.20° off (rms), 1.50° at most, joint 2\n"
        );
    }
}
