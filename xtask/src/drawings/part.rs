//! The parts of a schematic: wires, components, connectors, labels. Each has a shape and terminals.

use super::sheet::{Anchor, At, Placement, Sheet};

/// A part with two terminals, drawn along the line between them.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    Resistor,
    /// A capacitor whose first terminal is the plus.
    Electrolytic,
    /// Drawn from anode to cathode.
    Diode,
    /// A bidirectional ESD clamp.
    Clamp,
    Fuse,
    Switch,
}

/// One part, wire or label. All positions are grid units.
pub(super) enum Part {
    Wire(Vec<At>),
    Dot(At),
    Two {
        kind: Kind,
        ends: (At, At),
        text: String,
    },
    /// An N-channel transistor: gate at the point, drain above and source below on its right.
    Mosfet {
        gate: At,
        text: String,
    },
    /// A three-state gate: input, output, and an enable input above (active high) or below (active low).
    Gate {
        input: At,
        output: At,
        enable: Enable,
        text: String,
    },
    /// A frame with terminals on one side, each with its name and height on the sheet.
    Connector {
        x: i32,
        width: i32,
        faces: Side,
        pins: Vec<(i32, String)>,
        text: String,
    },
    Label {
        at: At,
        anchor: Anchor,
        text: String,
    },
}

/// The side of a connector with the wires.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Side {
    Left,
    Right,
}

/// The enable input of a three-state gate.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Enable {
    /// Active high, above the gate.
    High,
    /// Active low, below the gate.
    Low,
}

/// A wire through these points.
pub(super) fn wire(points: &[At]) -> Part {
    Part::Wire(points.to_vec())
}

/// A junction of wires.
pub(super) fn dot(x: i32, y: i32) -> Part {
    Part::Dot((x, y))
}

/// A part with two terminals.
pub(super) fn two(kind: Kind, from: At, to: At, text: &str) -> Part {
    Part::Two { kind, ends: (from, to), text: text.to_owned() }
}

/// A transistor.
pub(super) fn mosfet(gate: At, text: &str) -> Part {
    Part::Mosfet { gate, text: text.to_owned() }
}

/// A three-state gate.
pub(super) fn gate(input: At, output: At, enable: Enable, text: &str) -> Part {
    Part::Gate { input, output, enable, text: text.to_owned() }
}

/// A connector, or another part that is drawn as a frame. Its terminals are at `x`.
pub(super) fn connector(x: i32, width: i32, faces: Side, text: &str, pins: &[(i32, &str)]) -> Part {
    let pins = pins.iter().map(|&(y, name)| (y, name.to_owned())).collect();
    Part::Connector { x, width, faces, pins, text: text.to_owned() }
}

/// A label without a part.
pub(super) fn label(at: At, anchor: Anchor, text: &str) -> Part {
    Part::Label { at, anchor, text: text.to_owned() }
}

impl Part {
    /// The texts of this part, with position and alignment.
    pub(super) fn texts(&self) -> Vec<(At, Anchor, &str)> {
        match self {
            Self::Wire(_) | Self::Dot(_) => Vec::new(),
            Self::Label { at, anchor, text } => vec![(*at, *anchor, text.as_str())],
            Self::Two { ends: (from, to), text, .. } => vec![beside(*from, *to, text)],
            Self::Mosfet { gate: (x, y), text } => vec![((x + 5, *y), Anchor::Start, text.as_str())],
            Self::Gate { input, output, enable, text } => {
                let beyond_enable = if *enable == Enable::High { -4 } else { 5 };
                let at = (i32::midpoint(input.0, output.0) + 2, input.1 + beyond_enable);
                vec![(at, Anchor::Start, text.as_str())]
            }
            Self::Connector { x, width, faces, pins, text } => {
                connector_texts(*x, *width, *faces, pins, text)
            }
        }
    }

    pub(super) fn draw(&self, sheet: &mut Sheet) {
        match self {
            Self::Wire(points) => sheet.line(points),
            Self::Dot(at) => sheet.dot(*at),
            Self::Label { .. } => {}
            Self::Two { kind, ends: (from, to), .. } => draw_two(sheet, *kind, *from, *to),
            Self::Mosfet { gate, .. } => draw_mosfet(sheet, *gate),
            Self::Gate { input, output, enable, .. } => draw_gate(sheet, *input, *output, *enable),
            Self::Connector { x, width, faces, pins, .. } => draw_connector(sheet, *x, *width, *faces, pins),
        }
        for (at, anchor, text) in self.texts() {
            sheet.text(at, anchor, text);
        }
    }
}

fn middle((x1, y1): At, (x2, y2): At) -> (f64, f64) {
    (f64::from(x1 + x2) / 2.0, f64::from(y1 + y2) / 2.0)
}

/// The direction from one point to another in the same row or column, in degrees.
fn direction((x1, y1): At, (x2, y2): At) -> i32 {
    match (x2 - x1, y2 - y1) {
        (0, 0..) => 90,
        (0, _) => 270,
        (..0, _) => 180,
        _ => 0,
    }
}

/// The text of a part with two terminals: above it, or on the right of a vertical one.
fn beside((x1, y1): At, (x2, y2): At, text: &str) -> (At, Anchor, &str) {
    if x1 == x2 {
        ((x1 + 2, (y1 + y2) / 2), Anchor::Start, text)
    } else {
        (((x1 + x2) / 2, y1 - 3), Anchor::Middle, text)
    }
}

fn draw_two(sheet: &mut Sheet, kind: Kind, from: At, to: At) {
    let placement = Placement { at: middle(from, to), turn: direction(from, to) };
    let half = ((to.0 - from.0).abs() + (to.1 - from.1).abs()) * 5;
    let (body, gap) = match kind {
        Kind::Resistor => ("M-20 -7H20V7H-20Z", 20),
        Kind::Fuse => ("M-20 -7H20V7H-20Z M-20 0H20", 20),
        Kind::Electrolytic => ("M-4 -14V14 M4 -14Q10 0 4 14 M-14 -13H-8 M-11 -16V-10", 4),
        Kind::Diode => ("M10 -10V10", 10),
        Kind::Clamp => ("M-6 -14L0 -10V10L6 14 M-12 -8L0 0L-12 8Z M12 -8L0 0L12 8Z", 12),
        Kind::Switch => ("M-18 0L16 -14", 18),
    };
    sheet.symbol(placement, &format!("M-{half} 0H-{gap} M{gap} 0H{half} {body}"));
    match kind {
        Kind::Diode => sheet.filled(placement, "M-10 -10V10L10 0Z"),
        Kind::Switch => sheet.filled(placement, "M-18 -4a4 4 0 1 0 .1 0Z M18 -4a4 4 0 1 0 .1 0Z"),
        _ => {}
    }
}

/// Gate, channel and three leads, without the body diode.
fn draw_mosfet(sheet: &mut Sheet, (x, y): At) {
    let placement = Placement { at: (f64::from(x), f64::from(y)), turn: 0 };
    sheet.symbol(
        placement,
        "M0 0H14 M14 -14V14 M20 -16V-6 M20 -5V5 M20 6V16 M20 -11H30V-30 M20 11H30V30 M30 11V0H20",
    );
    sheet.filled(placement, "M21 0L28 -4V4Z");
}

fn draw_gate(sheet: &mut Sheet, input: At, output: At, enable: Enable) {
    let placement = Placement { at: middle(input, output), turn: direction(input, output) };
    let half = (output.0 - input.0).abs() * 5;
    sheet.symbol(placement, &format!("M-{half} 0H-20 M-20 -22V22L20 0Z M20 0H{half}"));
    let upright = Placement { turn: 0, ..placement };
    match enable {
        Enable::High => sheet.symbol(upright, "M0 -40V-11"),
        Enable::Low => sheet.symbol(upright, "M0 40V19 M-4 15a4 4 0 1 0 8 0a4 4 0 1 0 -8 0Z"),
    }
}

fn draw_connector(sheet: &mut Sheet, x: i32, width: i32, faces: Side, pins: &[(i32, String)]) {
    let top = pins.iter().map(|(y, _)| *y).min().unwrap_or_default() - 2;
    let bottom = pins.iter().map(|(y, _)| *y).max().unwrap_or_default() + 2;
    let (left, stub) = match faces {
        Side::Left => (x + 1, x + 1),
        Side::Right => (x - 1 - width, x - 1),
    };
    sheet.frame((left, top), (width, bottom - top));
    for (y, _) in pins {
        sheet.line(&[(x, *y), (stub, *y)]);
    }
}

fn connector_texts<'a>(
    x: i32,
    width: i32,
    faces: Side,
    pins: &'a [(i32, String)],
    text: &'a str,
) -> Vec<(At, Anchor, &'a str)> {
    let (inside, anchor, centre) = match faces {
        Side::Left => (x + 2, Anchor::Start, x + 1 + width / 2),
        Side::Right => (x - 2, Anchor::End, x - 1 - width / 2),
    };
    let top = pins.iter().map(|(y, _)| *y).min().unwrap_or_default();
    let mut texts: Vec<_> = pins.iter().map(|(y, name)| ((inside, *y), anchor, name.as_str())).collect();
    if !text.is_empty() {
        texts.push(((centre, top - 4), Anchor::Middle, text));
    }
    texts
}

#[cfg(test)]
impl Part {
    /// The points at which wires may end.
    pub(super) fn terminals(&self) -> Vec<At> {
        match self {
            Self::Wire(_) | Self::Dot(_) | Self::Label { .. } => Vec::new(),
            &Self::Two { ends: (from, to), .. } => vec![from, to],
            &Self::Mosfet { gate: (x, y), .. } => vec![(x, y), (x + 3, y - 3), (x + 3, y + 3)],
            &Self::Gate { input, output, enable, .. } => {
                vec![input, output, enable_of(input, output, enable)]
            }
            Self::Connector { x, pins, .. } => pins.iter().map(|(y, _)| (*x, *y)).collect(),
        }
    }
}

#[cfg(test)]
fn enable_of(input: At, output: At, enable: Enable) -> At {
    let x = i32::midpoint(input.0, output.0);
    if enable == Enable::High { (x, input.1 - 4) } else { (x, input.1 + 4) }
}
