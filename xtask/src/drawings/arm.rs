//! The arm from its side, with its dimensions, and the reach of its wrist: docs/kinematics.svg.
//!
//! Every point is computed by `kinematics`, so the drawing cannot differ from the program.

use std::fmt::Write;

use kinematics::geometry::{
    ELBOW_OFFSET, FOREARM, LEVEL_FOREARM, LINKAGE_MAX, LINKAGE_MIN, REAR_ARM, SHOULDER_FORWARD,
    SHOULDER_HEIGHT, TOOL,
};
use kinematics::{Frames, Vector, forward};

use super::sheet::STYLE;

/// The pose that is drawn, in degrees.
const POSE: [f64; 6] = [90.0, 105.0, 85.0, 90.0, 130.0, 90.0];
/// The angles of joints 2 and 3 at the corners of the reach, in order round it.
const CORNERS: [[f64; 2]; 6] = [
    [0.0, LINKAGE_MIN + LEVEL_FOREARM],
    [0.0, 180.0],
    [LINKAGE_MAX + LEVEL_FOREARM - 180.0, 180.0],
    [180.0, LINKAGE_MAX + LEVEL_FOREARM - 180.0],
    [180.0, 0.0],
    [LINKAGE_MIN + LEVEL_FOREARM, 0.0],
];
/// Points on each edge of the reach.
const EDGE_POINTS: u32 = 48;
/// Pixels in a millimetre.
const SCALE: f64 = 1.4;
/// What is drawn, in millimetres: forward of the base axis and above the top plate.
const LEFT: f64 = -230.0;
const RIGHT: f64 = 400.0;
const BOTTOM: f64 = -190.0;
const TOP: f64 = 430.0;

const ARM_STYLE: &str = "\
  <style>
    .reach { fill: #2f81f7; fill-opacity: 0.13; stroke: #2f81f7; stroke-width: 1 }
    .link { fill: none; stroke: #1f2328; stroke-width: 7; stroke-linecap: round; stroke-linejoin: round }
    .rod { stroke-width: 2 }
    .tool { stroke: #d1662a }
    .axis { stroke: #808a94; stroke-width: 1; stroke-dasharray: 5 4 }
    .pin { fill: #ffffff; stroke: #1f2328; stroke-width: 2 }
    @media (prefers-color-scheme: dark) {
      .link { stroke: #e6edf3 }
      .rod { stroke-width: 2 }
      .tool { stroke: #f0883e }
      .pin { fill: #0d1117; stroke: #e6edf3 }
    }
  </style>
";

/// The drawing.
pub(super) fn svg() -> String {
    let (width, height) = ((RIGHT - LEFT) * SCALE, (TOP - BOTTOM) * SCALE);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width:.0} {height:.0}\" width=\"{width:.0}\" \
         height=\"{height:.0}\" role=\"img\">\n  <!-- Made by `cargo xtask docs` from xtask/src/drawings/arm.rs. -->\n  \
         <title>The arm from its right side, with its dimensions and the reach of its wrist</title>\n"
    );
    svg += STYLE;
    svg += ARM_STYLE;
    let _ = writeln!(svg, "  <rect class=\"ground\" width=\"{width:.0}\" height=\"{height:.0}\"/>");
    reach(&mut svg);
    axes(&mut svg);
    arm(&mut svg, &forward(POSE));
    labels(&mut svg, &forward(POSE));
    svg + "</svg>\n"
}

/// A point of the arm's plane in pixels.
fn pixels(point: Vector<f64>) -> (f64, f64) {
    ((point.y - LEFT) * SCALE, (TOP - point.z) * SCALE)
}

/// A point of the arm's plane: forward of the base axis and above the top plate.
const fn at(forward: f64, up: f64) -> Vector<f64> {
    Vector::new(0.0, forward, up)
}

fn polyline(svg: &mut String, class: &str, points: impl IntoIterator<Item = Vector<f64>>) {
    let points: Vec<String> = points.into_iter().map(pixels).map(|(x, y)| format!("{x:.1},{y:.1}")).collect();
    let _ = writeln!(svg, "  <polyline class=\"{class}\" points=\"{}\"/>", points.join(" "));
}

fn text(svg: &mut String, anchor: &str, point: Vector<f64>, text: &str) {
    let (x, y) = pixels(point);
    let _ = writeln!(svg, "  <text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\">{text}</text>");
}

/// What the wrist reaches with the base forward: each edge holds one limit.
fn reach(svg: &mut String) {
    let next = CORNERS.iter().cycle().skip(1);
    let edges = CORNERS.iter().zip(next).flat_map(|(from, to)| {
        (0..=EDGE_POINTS).map(move |step| {
            let share = f64::from(step) / f64::from(EDGE_POINTS);
            let ([t2, t3], [u2, u3]) = (from, to);
            forward([90.0, t2 + (u2 - t2) * share, t3 + (u3 - t3) * share, 90.0, 90.0, 90.0]).arm.wrist
        })
    });
    polyline(svg, "reach", edges);
}

fn axes(svg: &mut String) {
    polyline(svg, "axis", [at(0.0, BOTTOM + 20.0), at(0.0, TOP - 20.0)]);
    polyline(svg, "axis", [at(LEFT + 20.0, 0.0), at(RIGHT - 20.0, 0.0)]);
    text(svg, "middle", at(RIGHT - 40.0, 8.0), "y forward");
    text(svg, "start", at(6.0, TOP - 30.0), "z up");
    text(svg, "end", at(-8.0, -16.0), "0");
    for mark in [-200, -100, 100, 200, 300_i32] {
        let along = f64::from(mark);
        polyline(svg, "axis", [at(along, -5.0), at(along, 5.0)]);
        text(svg, "middle", at(along, -18.0), &mark.to_string());
    }
}

fn arm(svg: &mut String, Frames { arm, hand }: &Frames<f64>) {
    let behind = arm.elbow + (arm.lever - arm.shoulder);
    polyline(svg, "link rod", [arm.shoulder, arm.lever, behind, arm.elbow]);
    polyline(svg, "link", [at(0.0, 0.0), at(0.0, SHOULDER_HEIGHT), arm.shoulder]);
    polyline(svg, "link", [arm.shoulder, arm.elbow, arm.forearm, arm.wrist]);
    polyline(svg, "link tool", [arm.wrist, hand.tip]);
    for (x, y) in [arm.shoulder, arm.lever, behind, arm.elbow, arm.wrist].map(pixels) {
        let _ = writeln!(svg, "  <circle class=\"pin\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"5\"/>");
    }
}

fn labels(svg: &mut String, Frames { arm, hand }: &Frames<f64>) {
    let middle = |from: Vector<f64>, to: Vector<f64>| (from + to) * 0.5;
    text(svg, "end", at(-8.0, SHOULDER_HEIGHT / 2.0), &format!("{SHOULDER_HEIGHT} mm"));
    text(
        svg,
        "start",
        arm.shoulder + at(10.0, -4.0),
        &format!("shoulder, joint 2, {SHOULDER_FORWARD} mm forward"),
    );
    text(svg, "start", middle(arm.shoulder, arm.elbow) + at(10.0, 0.0), &format!("rear arm {REAR_ARM} mm"));
    text(svg, "end", arm.elbow + at(-14.0, 32.0), &format!("elbow, {ELBOW_OFFSET} mm below the forearm"));
    text(svg, "start", middle(arm.forearm, arm.wrist) + at(0.0, 14.0), &format!("forearm {FOREARM} mm"));
    text(svg, "start", arm.wrist + at(10.0, 4.0), "wrist, joints 4, 5 and 6");
    text(svg, "start", hand.tip + at(4.0, -14.0), &format!("tip, {TOOL} mm from the wrist"));
    let far = forward([90.0, 30.0, LINKAGE_MIN + LEVEL_FOREARM - 30.0, 90.0, 90.0, 90.0]).arm.wrist;
    text(svg, "end", far + at(-14.0, 0.0), "reach of the wrist");
    let [_, t2, t3, ..] = POSE;
    let pose = format!("T2 = {t2}°, T3 = {t3}°: the forearm is {}° below the horizontal", t3 - LEVEL_FOREARM);
    text(svg, "start", at(LEFT + 20.0, BOTTOM + 20.0), &pose);
}

#[cfg(test)]
mod tests {
    use super::*;
    use kinematics::ik5;

    #[test]
    fn the_outline_is_the_end_of_the_reach_and_is_on_the_sheet() {
        let centre = forward([90.0, 90.0, 90.0, 90.0, 90.0, 90.0]).arm.wrist;
        for [t2, t3] in CORNERS {
            let corner = forward([90.0, t2, t3, 90.0, 90.0, 90.0]).arm.wrist;
            assert!(ik5(corner).is_ok(), "{t2} {t3}");
            let outward = (corner - centre).unit().unwrap();
            assert!(ik5(corner + outward).is_err(), "{t2} {t3}");
            assert!((LEFT..RIGHT).contains(&corner.y) && (BOTTOM..TOP).contains(&corner.z), "{corner:?}");
        }
    }

    #[test]
    fn the_dimensions_are_written() {
        let svg = svg();
        for length in ["120 mm", "198.5 mm", "74.5 mm", "29.35 mm", "22.46 mm", "25 mm"] {
            assert!(svg.contains(length), "{length}");
        }
    }
}
