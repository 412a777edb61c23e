//! A sheet of SVG: lines, filled shapes and text, on a grid of 10 pixels.

use std::fmt::Write;

/// A point on the sheet, in grid units: x to the right, y downwards.
pub(super) type At = (i32, i32);

/// Pixels in a grid unit.
const GRID: i32 = 10;
/// Distance between two lines of text, in pixels.
const LINE: i32 = 17;

/// The reader's colour scheme selects dark lines on white or light lines on black.
pub(super) const STYLE: &str = "\
  <style>
    .ground { fill: #ffffff }
    .line { fill: none; stroke: #1f2328; stroke-width: 2; stroke-linecap: round; stroke-linejoin: round }
    .solid { fill: #1f2328; stroke: none }
    text { font-family: Helvetica, Arial, 'DejaVu Sans', sans-serif; font-size: 14px; fill: #1f2328 }
    .title { font-weight: bold }
    @media (prefers-color-scheme: dark) {
      .ground { fill: #0d1117 }
      .line { stroke: #e6edf3 }
      .solid, text { fill: #e6edf3 }
    }
  </style>
";

/// The part of a text that is at its point.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Anchor {
    Start,
    Middle,
    End,
}

/// The position and direction of a symbol. Its own x axis points from its first terminal to its second.
#[derive(Clone, Copy)]
pub(super) struct Placement {
    /// The middle of the symbol.
    pub(super) at: (f64, f64),
    /// Clockwise, in degrees.
    pub(super) turn: i32,
}

/// An incomplete SVG.
pub(super) struct Sheet {
    svg: String,
}

impl Sheet {
    pub(super) fn new((width, height): At, title: &str) -> Self {
        let (w, h) = (width * GRID, height * GRID);
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {w} {h}\" width=\"{w}\" height=\"{h}\" role=\"img\">\n"
        );
        svg += "  <!-- Made by `cargo xtask docs` from xtask/src/drawings/circuits.rs. Change the table there. -->\n";
        let _ = writeln!(svg, "  <title>{}</title>", escaped(title));
        svg += STYLE;
        let _ = writeln!(svg, "  <rect class=\"ground\" width=\"{w}\" height=\"{h}\"/>");
        let mut sheet = Self { svg };
        sheet.write_text((2, 3), Anchor::Start, "title", title);
        sheet
    }

    /// A line through points of the grid.
    pub(super) fn line(&mut self, points: &[At]) {
        let points: Vec<String> = points.iter().map(|(x, y)| format!("{},{}", x * GRID, y * GRID)).collect();
        let _ = writeln!(self.svg, "  <polyline class=\"line\" points=\"{}\"/>", points.join(" "));
    }

    /// Draws a symbol from SVG path data, in pixels round its middle, as lines.
    pub(super) fn symbol(&mut self, placement: Placement, path: &str) {
        self.path("line", placement, path);
    }

    /// Draws a filled symbol.
    pub(super) fn filled(&mut self, placement: Placement, path: &str) {
        self.path("solid", placement, path);
    }

    fn path(&mut self, class: &str, Placement { at: (x, y), turn }: Placement, path: &str) {
        let (x, y) = (x * f64::from(GRID), y * f64::from(GRID));
        let _ = writeln!(
            self.svg,
            "  <path class=\"{class}\" transform=\"translate({x} {y}) rotate({turn})\" d=\"{path}\"/>"
        );
    }

    /// Draws the frame of a part with several terminals.
    pub(super) fn frame(&mut self, (x, y): At, (width, height): At) {
        let [x, y, width, height] = [x, y, width, height].map(|length| length * GRID);
        let _ = writeln!(
            self.svg,
            "  <rect class=\"line\" x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\" rx=\"4\"/>"
        );
    }

    /// Draws the dot of a junction.
    pub(super) fn dot(&mut self, (x, y): At) {
        let _ =
            writeln!(self.svg, "  <circle class=\"solid\" cx=\"{}\" cy=\"{}\" r=\"4\"/>", x * GRID, y * GRID);
    }

    /// Writes text of one or more lines. The point is at half of their height.
    pub(super) fn text(&mut self, at: At, anchor: Anchor, text: &str) {
        self.write_text(at, anchor, "label", text);
    }

    fn write_text(&mut self, (x, y): At, anchor: Anchor, class: &str, text: &str) {
        let anchor = match anchor {
            Anchor::Start => "start",
            Anchor::Middle => "middle",
            Anchor::End => "end",
        };
        let lines: Vec<&str> = text.lines().collect();
        let rows = i32::try_from(lines.len()).unwrap_or(1);
        // A baseline 5 pixels below the point centres letters of 14 pixels.
        let mut baseline = y * GRID + 5 - (rows - 1) * LINE / 2;
        for line in lines {
            let _ = writeln!(
                self.svg,
                "  <text class=\"{class}\" x=\"{}\" y=\"{baseline}\" text-anchor=\"{anchor}\">{}</text>",
                x * GRID,
                escaped(line)
            );
            baseline += LINE;
        }
    }

    pub(super) fn finish(self) -> String {
        self.svg + "</svg>\n"
    }
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;")
}
