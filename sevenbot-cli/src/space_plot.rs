//! An SVG plot of the tip's way in space: from above, from the front and from the right side, at one scale.
//!
//! ```text
//!    from above      from the front     from the right
//!   y ┤   ╭──╮       z ┤ ╭──╮           z ┤   ╭─╮
//!     ┤ ──╯            ┤─╯                ┤ ──╯          suction: broad line
//!     └──┬──┬─ x       └──┬──┬─ x         └──┬──┬─ y
//! ```
//!
//! Knows points in millimetres, not the arm or the recording.

use std::fmt::Write;

use sevenbot::cartesian::Vector;

use crate::svg;

#[derive(Clone, Copy, Debug)]
pub(crate) struct WayPoint {
    /// The tip, in millimetres.
    pub(crate) tip: Vector,
    /// Does the pump suck?
    pub(crate) vacuum: bool,
}

// These lengths are in pixels.
const PANEL: f64 = 340.0;
const GAP: f64 = 56.0;
const TOP: f64 = 72.0;
const BOTTOM: f64 = 48.0;
/// Radius of the base on the drawing, in millimetres.
const BASE_MM: f64 = 65.0;
/// Distance between two lines of the grid, in millimetres.
const GRID_MM: f64 = 100.0;
/// Space round the way, in millimetres.
const MARGIN_MM: f64 = 20.0;

const STYLE: &str = "\
text { font: 12px sans-serif; fill: #444 } .title { font-size: 15px; fill: #111 } .end { text-anchor: end }
.middle { text-anchor: middle } .panel { fill: #fafafa; stroke: #ddd } .grid { stroke: #e4e4e4 }
.base { fill: none; stroke: #999; stroke-dasharray: 4 3 } polyline { fill: none; stroke-linejoin: round }
.suction { stroke: #f2b56b; stroke-width: 7; stroke-linecap: round } .way { stroke: #1b5e9e; stroke-width: 1.5 }
.first { fill: #2e9e4f } .last { fill: #c0392b }";

/// One of the three views: its heading, the names of its axes, and the coordinates of a point in it.
struct SpaceView {
    heading: &'static str,
    axes: [&'static str; 2],
    flat: fn(Vector) -> [f64; 2],
}

const VIEWS: [SpaceView; 3] = [
    SpaceView { heading: "from above", axes: ["x", "y"], flat: |point| [point.x, point.y] },
    SpaceView { heading: "from the front", axes: ["x", "z"], flat: |point| [point.x, point.z] },
    SpaceView { heading: "from the right", axes: ["y", "z"], flat: |point| [point.y, point.z] },
];

pub(crate) fn drawing(title: &str, way: &[WayPoint]) -> String {
    let (width, height) = (3.0 * (PANEL + GAP) + GAP / 2.0, TOP + PANEL + BOTTOM);
    let mut out = svg::sheet(width, height, STYLE);
    svg::text(&mut out, "title", [GAP, 26.0], &svg::escaped(title));
    svg::text(
        &mut out,
        "",
        [GAP, 46.0],
        "millimetres; green: start, red: end, broad: suction, dashed: the base",
    );
    let span = span(way);
    for (view, number) in VIEWS.iter().zip(0..) {
        let left = GAP + f64::from(number) * (PANEL + GAP);
        Panel::of(view, way, left, span).draw(&mut out, way);
    }
    svg::end(out)
}

/// The side of all panels in millimetres: the largest extent of the way and the origin in any direction, at least [`GRID_MM`],
/// and a margin on both sides.
fn span(way: &[WayPoint]) -> f64 {
    let extents = VIEWS.iter().flat_map(|view| bounds(view, way)).map(|[low, high]| high - low);
    extents.fold(GRID_MM, f64::max) + 2.0 * MARGIN_MM
}

/// The smallest and the largest coordinate on each axis of a view. 0 is always inside.
fn bounds(view: &SpaceView, way: &[WayPoint]) -> [[f64; 2]; 2] {
    way.iter().map(|point| (view.flat)(point.tip)).fold([[0.0; 2]; 2], |[[a, b], [c, d]], [u, v]| {
        [[f64::min(a, u), f64::max(b, u)], [f64::min(c, v), f64::max(d, v)]]
    })
}

/// A view on the sheet.
struct Panel<'a> {
    view: &'a SpaceView,
    left: f64,
    /// The coordinates at its lower left corner, in millimetres.
    corner: [f64; 2],
    span: f64,
}

impl<'a> Panel<'a> {
    fn of(view: &'a SpaceView, way: &[WayPoint], left: f64, span: f64) -> Self {
        let corner = bounds(view, way).map(|[low, high]| f64::midpoint(low, high) - span / 2.0);
        Self { view, left, corner, span }
    }

    /// A point of the view in pixels.
    fn at(&self, [u, v]: [f64; 2]) -> [f64; 2] {
        let [low, bottom] = self.corner;
        let scale = PANEL / self.span;
        [self.left + (u - low) * scale, TOP + PANEL - (v - bottom) * scale]
    }

    fn draw(&self, out: &mut String, way: &[WayPoint]) {
        let Self { left, .. } = self;
        let _ = writeln!(
            out,
            "<rect class=\"panel\" x=\"{left:.1}\" y=\"{TOP}\" width=\"{PANEL}\" height=\"{PANEL}\"/>"
        );
        let [across, up] = self.view.axes;
        svg::text(out, "middle", [left + PANEL / 2.0, TOP - 8.0], self.view.heading);
        svg::text(out, "middle", [left + PANEL / 2.0, TOP + PANEL + 36.0], across);
        svg::text(out, "end", [left - 8.0, TOP + 12.0], up);
        self.grid(out);
        self.base(out);
        for part in way
            .chunk_by(|one, next| one.vacuum == next.vacuum)
            .filter(|part| part.iter().any(|point| point.vacuum))
        {
            self.line(out, "suction", part);
        }
        self.line(out, "way", way);
        for (class, point) in [("first", way.first()), ("last", way.last())] {
            if let Some(point) = point {
                let [x, y] = self.at((self.view.flat)(point.tip));
                let _ = writeln!(out, "<circle class=\"{class}\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"4.5\"/>");
            }
        }
    }

    fn grid(&self, out: &mut String) {
        let [low, bottom] = self.corner;
        for mark in marks(low, self.span) {
            let [x, _] = self.at([mark, 0.0]);
            let _ = writeln!(out, "<path class=\"grid\" d=\"M{x:.1} {TOP}V{:.1}\"/>", TOP + PANEL);
            svg::text(out, "middle", [x, TOP + PANEL + 18.0], &mark.to_string());
        }
        for mark in marks(bottom, self.span) {
            let [_, y] = self.at([0.0, mark]);
            let _ = writeln!(out, "<path class=\"grid\" d=\"M{:.1} {y:.1}h{PANEL}\"/>", self.left);
            svg::text(out, "end", [self.left - 6.0, y + 4.0], &mark.to_string());
        }
    }

    /// Draws the base: a circle in the view from above, its top plate as a line in the others.
    fn base(&self, out: &mut String) {
        let [x, y] = self.at([0.0, 0.0]);
        let radius = BASE_MM * PANEL / self.span;
        let _ = match self.view.axes {
            ["x", "y"] => {
                writeln!(out, "<circle class=\"base\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{radius:.1}\"/>")
            }
            _ => writeln!(out, "<path class=\"base\" d=\"M{:.1} {y:.1}h{:.1}\"/>", x - radius, 2.0 * radius),
        };
    }

    fn line(&self, out: &mut String, class: &str, way: &[WayPoint]) {
        svg::line(out, class, way.iter().map(|point| self.at((self.view.flat)(point.tip)).into()));
    }
}

/// The multiples of the grid's distance within a span.
fn marks(low: f64, span: f64) -> impl Iterator<Item = f64> {
    let first = (low / GRID_MM).ceil();
    (0..)
        .map(move |step: u32| (first + f64::from(step)) * GRID_MM + 0.0)
        .take_while(move |mark| *mark <= low + span)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn way(points: &[([f64; 3], bool)]) -> Vec<WayPoint> {
        points.iter().map(|&([x, y, z], vacuum)| WayPoint { tip: Vector::new(x, y, z), vacuum }).collect()
    }

    #[test]
    fn every_view_shows_the_way_and_its_suction() {
        let way =
            way(&[([0.0, 200.0, 50.0], false), ([-80.0, 200.0, 50.0], true), ([-80.0, 200.0, 150.0], true)]);
        let drawing = drawing("a < b", &way);
        assert_eq!(drawing.matches("class=\"way\"").count(), 3);
        assert_eq!(drawing.matches("class=\"suction\"").count(), 3);
        assert_eq!(drawing.matches("<circle class=\"base\"").count(), 1);
        assert!(drawing.contains("a &lt; b") && drawing.contains(">-100<"), "{drawing}");
    }

    #[test]
    fn all_points_are_on_their_panels() {
        let way = way(&[([-300.0, -20.0, 400.0], false), ([250.0, 340.0, -120.0], false)]);
        for view in &VIEWS {
            let panel = Panel::of(view, &way, 0.0, span(&way));
            for point in &way {
                let [x, y] = panel.at((view.flat)(point.tip));
                assert!((0.0..=PANEL).contains(&x) && (TOP..=TOP + PANEL).contains(&y), "{x} {y}");
            }
        }
    }

    #[test]
    fn nothing_at_all_can_be_plotted() {
        let drawing = drawing("nothing", &[]);
        assert!(!drawing.contains("NaN") && !drawing.contains("inf"), "{drawing}");
    }
}
