use std::collections::BTreeSet;

use super::circuits;
use super::part::Part;
use super::sheet::{Anchor, At};

/// True if a point is on the wire through these points.
fn is_on(points: &[At], (x, y): At) -> bool {
    points.windows(2).any(|pair| {
        let [(x1, y1), (x2, y2)] = *pair else { return false };
        (x1.min(x2)..=x1.max(x2)).contains(&x) && (y1.min(y2)..=y1.max(y2)).contains(&y)
    })
}

/// A box in pixels: left, top, right, bottom.
type TextBox = [i32; 4];

/// The box of a text, with 8 pixels for each letter, which is more than the average.
fn text_box((x, y): At, anchor: Anchor, text: &str) -> TextBox {
    let letters = text.lines().map(|line| line.chars().count()).max().unwrap_or_default();
    let width = i32::try_from(letters).unwrap() * 8;
    let height = i32::try_from(text.lines().count()).unwrap() * 17;
    let left = match anchor {
        Anchor::Start => x * 10,
        Anchor::Middle => x * 10 - width / 2,
        Anchor::End => x * 10 - width,
    };
    [left, y * 10 - height / 2, left + width, y * 10 + height / 2]
}

fn overlap(a: TextBox, b: TextBox) -> bool {
    a[0] < b[2] && b[0] < a[2] && a[1] < b[3] && b[1] < a[3]
}

#[test]
fn wires_are_straight_and_connected() {
    for drawing in circuits::all() {
        let terminals: BTreeSet<At> = drawing.parts.iter().flat_map(Part::terminals).collect();
        let wires: Vec<&Vec<At>> = drawing
            .parts
            .iter()
            .filter_map(|part| if let Part::Wire(points) = part { Some(points) } else { None })
            .collect();
        let labels: Vec<(At, Anchor, &str)> = drawing.parts.iter().flat_map(Part::texts).collect();
        for points in &wires {
            for pair in points.windows(2) {
                assert!(pair[0].0 == pair[1].0 || pair[0].1 == pair[1].1, "{}: {pair:?}", drawing.name);
            }
            for end in [points[0], points[points.len() - 1]] {
                let at_wire = wires.iter().any(|other| other != points && is_on(other, end));
                let at_label =
                    labels.iter().any(|((x, y), ..)| (x - end.0).abs() <= 2 && (y - end.1).abs() <= 2);
                assert!(terminals.contains(&end) || at_wire || at_label, "{}: open at {end:?}", drawing.name);
            }
        }
    }
}

#[test]
fn every_terminal_is_wired() {
    for drawing in circuits::all() {
        let terminals: Vec<At> = drawing.parts.iter().flat_map(Part::terminals).collect();
        for at in &terminals {
            let wired = drawing.parts.iter().any(|part| match part {
                Part::Wire(points) => is_on(points, *at),
                Part::Label { at: label, .. } => label.0 == at.0 && (label.1 - at.1).abs() <= 2,
                _ => false,
            });
            let shared = terminals.iter().filter(|other| *other == at).count() > 1;
            assert!(wired || shared, "{}: nothing at {at:?}", drawing.name);
        }
    }
}

#[test]
fn dots_join_wires() {
    for drawing in circuits::all() {
        let terminals: Vec<At> = drawing.parts.iter().flat_map(Part::terminals).collect();
        for part in &drawing.parts {
            let Part::Dot(at) = part else { continue };
            let wires = drawing
                .parts
                .iter()
                .filter(|part| matches!(part, Part::Wire(points) if is_on(points, *at)))
                .count();
            let ends = terminals.iter().filter(|terminal| *terminal == at).count();
            assert!(wires > 0 && wires + ends > 1, "{}: a dot at {at:?} joins nothing", drawing.name);
        }
    }
}

#[test]
fn texts_are_on_the_sheet_and_do_not_overlap() {
    for drawing in circuits::all() {
        let texts: Vec<(TextBox, &str)> = drawing
            .parts
            .iter()
            .flat_map(Part::texts)
            .map(|(at, anchor, text)| (text_box(at, anchor, text), text))
            .collect();
        for (index, (a, text)) in texts.iter().enumerate() {
            let [left, top, right, bottom] = *a;
            let on_sheet =
                left >= 0 && top >= 0 && right <= drawing.size.0 * 10 && bottom <= drawing.size.1 * 10;
            assert!(on_sheet, "{}: {text:?} leaves the sheet", drawing.name);
            for (b, other) in &texts[index + 1..] {
                assert!(!overlap(*a, *b), "{}: {text:?} covers {other:?}", drawing.name);
            }
        }
    }
}
