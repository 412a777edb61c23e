//! An SVG plot of a movement: target and measured position of each joint over time.
//!
//! ```text
//!   joint 1   120 ┤   ╭──╮          one panel per joint, with a common time axis
//!              90 ┤───╯  ╰───       target: broad pale line; measured position: thin dark line
//!                 └──┬──┬──┬─
//! ```
//!
//! Knows times and angles, not the arm or the recording.

use std::fmt::Write;

use crate::svg;

/// Seconds and degrees.
pub(crate) type PlotPoint = (f64, f64);

#[derive(Clone, Debug, Default)]
pub(crate) struct JointTrack {
    pub(crate) target: Vec<PlotPoint>,
    pub(crate) measured: Vec<PlotPoint>,
}

// All lengths are in pixels.
const WIDTH: f64 = 860.0;
const LEFT: f64 = 96.0;
const RIGHT: f64 = 16.0;
const TOP: f64 = 56.0;
const BOTTOM: f64 = 40.0;
const PANEL: f64 = 78.0;
/// Distance between two panels.
const GAP: f64 = 14.0;

/// The smallest range of the degree axis. It keeps small movements small in the plot.
const MIN_DEGREES_SHOWN: f64 = 20.0;

const STYLE: &str = "\
text { font: 12px sans-serif; fill: #444 } .title { font-size: 15px; fill: #111 } .joint { font-weight: bold }
.panel { fill: #fafafa; stroke: #ddd } .grid { stroke: #e4e4e4 } .end { text-anchor: end }
.middle { text-anchor: middle } polyline { fill: none; stroke-linejoin: round }
.target { stroke: #f2b56b; stroke-width: 5 } .measured { stroke: #1b5e9e; stroke-width: 1.5 }";

pub(crate) fn drawing(title: &str, tracks: &[JointTrack; 7]) -> String {
    let seconds = AxisScale::of_time(tracks);
    let height = TOP + 7.0 * (PANEL + GAP) - GAP + BOTTOM;
    let mut out = svg::sheet(WIDTH, height, STYLE);
    heading(&mut out, title);
    for ((track, top), number) in tracks.iter().zip(tops()).zip(1..) {
        panel(&mut out, number, track, top, &seconds);
    }
    axis_of_time(&mut out, &seconds, height - BOTTOM);
    svg::end(out)
}

fn tops() -> impl Iterator<Item = f64> {
    std::iter::successors(Some(TOP), |top| Some(top + PANEL + GAP))
}

fn heading(out: &mut String, title: &str) {
    svg::text(out, "title", [LEFT, 24.0], &svg::escaped(title));
    let legend = [("target", "target", 0.0), ("measured", "measured position", 100.0)];
    for (class, label, offset) in legend {
        svg::line(out, class, [(LEFT + offset, 42.0), (LEFT + offset + 24.0, 42.0)]);
        svg::text(out, "", [LEFT + offset + 30.0, 46.0], label);
    }
}

fn panel(out: &mut String, number: u8, track: &JointTrack, top: f64, seconds: &AxisScale) {
    let degrees = AxisScale::of_degrees(track, top);
    let width = WIDTH - LEFT - RIGHT;
    let _ = writeln!(
        out,
        "<rect class=\"panel\" x=\"{LEFT}\" y=\"{top:.1}\" width=\"{width}\" height=\"{PANEL}\"/>"
    );
    svg::text(out, "joint", [16.0, top + PANEL / 2.0 + 4.0], &format!("joint {number}"));
    for tick in degrees.ticks(4.0) {
        let y = degrees.at(tick);
        let _ = writeln!(out, "<path class=\"grid\" d=\"M{LEFT} {y:.1}H{:.1}\"/>", WIDTH - RIGHT);
        svg::text(out, "end", [LEFT - 6.0, y + 4.0], &format!("{tick}°"));
    }
    for (class, points) in [("target", &track.target), ("measured", &track.measured)] {
        svg::line(out, class, points.iter().map(|&(x, y)| (seconds.at(x), degrees.at(y))));
    }
}

fn axis_of_time(out: &mut String, seconds: &AxisScale, bottom: f64) {
    for tick in seconds.ticks(10.0) {
        svg::text(out, "middle", [seconds.at(tick), bottom + 18.0], &format!("{tick}"));
    }
    svg::text(out, "end", [WIDTH - RIGHT, bottom + 34.0], "seconds");
}

/// Converts a value to a coordinate.
struct AxisScale {
    low: f64,
    high: f64,
    /// The coordinate of `low`.
    from: f64,
    /// The coordinate of `high`.
    to: f64,
}

impl AxisScale {
    fn of_time(tracks: &[JointTrack; 7]) -> Self {
        let times = tracks.iter().flat_map(|track| track.target.iter().chain(&track.measured));
        let high = times.map(|point| point.0).fold(0.1, f64::max);
        Self { low: 0.0, high, from: LEFT, to: WIDTH - RIGHT }
    }

    /// An axis for the track, with padding.
    fn of_degrees(track: &JointTrack, top: f64) -> Self {
        let all = || track.target.iter().chain(&track.measured).map(|point| point.1);
        let (low, high) = (all().fold(180.0, f64::min), all().fold(0.0, f64::max));
        let (low, high) = if low > high { (0.0, 180.0) } else { (low, high) };
        let padding = ((MIN_DEGREES_SHOWN - (high - low)) / 2.0).max(3.0);
        Self { low: low - padding, high: high + padding, from: top + PANEL, to: top }
    }

    fn at(&self, value: f64) -> f64 {
        self.from + (value - self.low) / (self.high - self.low) * (self.to - self.from)
    }

    /// About `count` round values.
    fn ticks(&self, count: f64) -> impl Iterator<Item = f64> {
        let rough = (self.high - self.low) / count;
        let magnitude = 10_f64.powf(rough.log10().floor());
        let round = [1.0, 2.0, 5.0].into_iter().map(|factor| factor * magnitude);
        let step = round.into_iter().find(|step| *step >= rough).unwrap_or(10.0 * magnitude);
        let first = (self.low / step).ceil();
        let high = self.high;
        // Rounding avoids labels such as 0.30000000000000004.
        let value = move |index: u32| ((first + f64::from(index)) * step * 1e6).round() / 1e6;
        (0..).map(value).take_while(move |tick| *tick <= high)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scale(low: f64, high: f64) -> AxisScale {
        AxisScale { low, high, from: 0.0, to: 100.0 }
    }

    #[test]
    fn ticks_are_round_and_inside() {
        let ticks = |low, high, count| scale(low, high).ticks(count).collect::<Vec<_>>();
        assert_eq!(ticks(0.0, 1.0, 10.0), [0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0]);
        assert_eq!(ticks(77.0, 123.0, 3.0), [80.0, 100.0, 120.0]);
        assert_eq!(ticks(0.0, 7.3, 10.0), [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]);
    }

    #[test]
    fn every_joint_has_a_panel_with_both_lines() {
        let track = JointTrack { target: vec![(0.0, 90.0), (1.0, 120.0)], measured: vec![(0.0, 90.0)] };
        let tracks = std::array::from_fn(|_| track.clone());
        let drawing = drawing("a < b & c", &tracks);
        assert!(drawing.contains("a &lt; b &amp; c"));
        assert_eq!(drawing.matches("class=\"panel\"").count(), 7);
        assert_eq!(drawing.matches("<polyline").count(), 2 * 7 + 2, "and the legend's");
        assert!(!drawing.contains("NaN") && !drawing.contains("inf"), "{drawing}");
    }

    #[test]
    fn an_empty_plot_has_finite_numbers() {
        let drawing = drawing("nothing", &Default::default());
        assert!(!drawing.contains("NaN") && !drawing.contains("inf"), "{drawing}");
    }
}
