//! The elements of the drawings in SVG. Coordinates are pixels.

use std::fmt::Write;

/// The start of a drawing on white paper. `style` has the classes of its elements.
pub(crate) fn sheet(width: f64, height: f64, style: &str) -> String {
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" \
         height=\"{height}\">\n<style>{style}</style>\n<rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n"
    )
}

pub(crate) fn end(drawing: String) -> String {
    drawing + "</svg>\n"
}

pub(crate) fn text(out: &mut String, class: &str, [x, y]: [f64; 2], text: &str) {
    let _ = writeln!(out, "<text class=\"{class}\" x=\"{x:.1}\" y=\"{y:.1}\">{text}</text>");
}

pub(crate) fn line(out: &mut String, class: &str, points: impl IntoIterator<Item = (f64, f64)>) {
    let points: Vec<String> = points.into_iter().map(|(x, y)| format!("{x:.1},{y:.1}")).collect();
    let _ = writeln!(out, "<polyline class=\"{class}\" points=\"{}\"/>", points.join(" "));
}

pub(crate) fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}
