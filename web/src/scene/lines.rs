//! The lines of the scene: the grid on the table with its labels in mm, the plumb line below the tip, and the dashed line
//! to a wanted position to which the arm does not go.

use glam::{Vec2, Vec3};
use kinematics::geometry::BASE_HEIGHT;

use super::arm::tip_of;
use super::camera::Camera;
use super::theme::{Palette, Rgb};
use super::view::View;

/// The distance between lines of the grid, in mm.
const STEP: f32 = 50.0;
/// The number of steps from the middle of the grid to its outermost line.
const STEPS: i16 = 9;
/// The height of a character of a label, in mm.
const LABEL: f32 = 13.0;
/// The length of a dash and of a gap, in mm.
const DASH: f32 = 6.0;

/// The height of the table in the frame of the arm, in mm.
#[expect(clippy::cast_possible_truncation, reason = "a whole number of millimetres")]
pub const TABLE: f32 = -BASE_HEIGHT as f32;

/// An end of a line, or a corner of a triangle without lighting: x, y, z in mm, then red, green, blue and opacity from 0 to 1.
pub type LineEnd = [f32; 7];

/// The lines of a view, two ends for each line.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Lines {
    /// Lines that are drawn before the arm, so that the arm hides them.
    pub ground: Vec<LineEnd>,
    /// Lines that are drawn after the arm without a depth test, so that nothing hides them.
    pub over: Vec<LineEnd>,
}

impl Lines {
    #[must_use]
    pub fn of(view: &View, camera: &Camera) -> Self {
        let palette = view.theme.palette();
        let mut lines = Self::default();
        grid(&mut lines.ground, palette);
        labels(&mut lines.ground, palette, camera);
        let tip = tip_of(view.measured);
        plumb_line(&mut lines.ground, tip, palette.tip);
        if let Some(wish) = view.unreachable {
            let from = tip_of(view.targets.unwrap_or(view.measured));
            dashes(&mut lines.over, from, wish, palette.unreachable);
        }
        lines
    }
}

fn line(lines: &mut Vec<LineEnd>, ends: [Vec3; 2], colour: Rgb, opacities: [f32; 2]) {
    let [red, green, blue] = colour.floats();
    let ends = ends.into_iter().zip(opacities);
    lines.extend(ends.map(|(Vec3 { x, y, z }, opacity)| [x, y, z, red, green, blue, opacity]));
}

/// A square grid that fades towards a circular edge. Lines at multiples of 100 mm are stronger.
fn grid(lines: &mut Vec<LineEnd>, palette: &Palette) {
    let radius = f32::from(STEPS) * STEP + STEP / 2.0;
    for step in -STEPS..=STEPS {
        let aside = f32::from(step) * STEP;
        let half = (radius * radius - aside * aside).max(0.0).sqrt();
        let strength = match step {
            0 => 1.0,
            step if step % 2 == 0 => 0.8,
            _ => 0.35,
        };
        let colour = if step == 0 { palette.text } else { palette.grid };
        let fade = [0.0, strength * (half / radius), 0.0];
        for across in [false, true] {
            let at = |along: f32| {
                if across { Vec3::new(along, aside, TABLE) } else { Vec3::new(aside, along, TABLE) }
            };
            let [outer, middle, _] = fade;
            line(lines, [at(-half), at(0.0)], colour, [outer, middle]);
            line(lines, [at(0.0), at(half)], colour, [middle, outer]);
        }
    }
}

/// Numbers in mm along both axes, and the names of the axes. They face the camera.
fn labels(lines: &mut Vec<LineEnd>, palette: &Palette, camera: &Camera) {
    for hundreds in [-4_i16, -3, -2, -1, 1, 2, 3, 4] {
        let distance = f32::from(hundreds) * 100.0;
        let text = format!("{}", hundreds * 100);
        write(lines, palette, camera, Vec3::new(distance, 0.0, TABLE), &text);
        write(lines, palette, camera, Vec3::new(0.0, distance, TABLE), &text);
    }
    let end = f32::from(STEPS) * STEP + STEP / 2.0;
    write(lines, palette, camera, Vec3::new(end, 0.0, TABLE), "x mm");
    write(lines, palette, camera, Vec3::new(0.0, end, TABLE), "y mm");
}

fn write(lines: &mut Vec<LineEnd>, palette: &Palette, camera: &Camera, at: Vec3, text: &str) {
    let (right, up) = camera.screen_axes();
    // In units of a quarter of the height, a character is 2 wide and 4 high, with a gap of 1 to the next one.
    let unit = LABEL / 4.0;
    for (place, character) in (0_u16..).zip(text.chars()) {
        let left = f32::from(place) * 3.0 + 1.5;
        for [from, to] in strokes(character).iter().copied() {
            let point = |[x, y]: [f32; 2]| at + right * ((x + left) * unit) + up * ((y - 5.0) * unit);
            line(lines, [point(from), point(to)], palette.text, [0.9, 0.9]);
        }
    }
}

type Stroke = [[f32; 2]; 2];

const TOP: Stroke = [[0.0, 4.0], [2.0, 4.0]];
const MIDDLE: Stroke = [[0.0, 2.0], [2.0, 2.0]];
const BOTTOM: Stroke = [[0.0, 0.0], [2.0, 0.0]];
const LEFT: Stroke = [[0.0, 0.0], [0.0, 4.0]];
const RIGHT: Stroke = [[2.0, 0.0], [2.0, 4.0]];
const UPPER_RIGHT: Stroke = [[2.0, 2.0], [2.0, 4.0]];
const LOWER_LEFT: Stroke = [[0.0, 0.0], [0.0, 2.0]];
const UPPER_LEFT: Stroke = [[0.0, 2.0], [0.0, 4.0]];

/// The strokes of a character, in a field 2 wide and 4 high. Only the `y` goes below its field.
const fn strokes(character: char) -> &'static [Stroke] {
    match character {
        '-' => &[MIDDLE],
        '0' => &[TOP, BOTTOM, LEFT, RIGHT],
        '1' => &[[[1.0, 0.0], [1.0, 4.0]], [[1.0, 4.0], [0.2, 3.2]]],
        '2' => &[TOP, UPPER_RIGHT, MIDDLE, LOWER_LEFT, BOTTOM],
        '3' => &[TOP, MIDDLE, BOTTOM, RIGHT],
        '4' => &[UPPER_LEFT, MIDDLE, RIGHT],
        'x' => &[[[0.0, 0.0], [2.0, 2.5]], [[0.0, 2.5], [2.0, 0.0]]],
        'y' => &[[[0.0, 2.5], [1.0, 0.6]], [[2.0, 2.5], [0.4, -1.0]]],
        'm' => &[
            [[0.0, 0.0], [0.0, 2.5]],
            [[0.0, 2.5], [2.0, 2.5]],
            [[1.0, 0.0], [1.0, 2.5]],
            [[2.0, 0.0], [2.0, 2.5]],
        ],
        _ => &[],
    }
}

/// A line from the tip down to the table, with a ring at its foot.
fn plumb_line(lines: &mut Vec<LineEnd>, tip: Vec3, colour: Rgb) {
    let foot = tip.with_z(TABLE);
    line(lines, [tip, foot], colour, [0.55, 0.55]);
    let around = |part: u8| {
        let across = Vec2::from_angle(f32::from(part) * std::f32::consts::TAU / 24.0) * 9.0;
        foot + across.extend(0.0)
    };
    for part in 0..24 {
        line(lines, [around(part), around(part + 1)], colour, [0.8, 0.8]);
    }
}

fn dashes(lines: &mut Vec<LineEnd>, from: Vec3, to: Vec3, colour: Rgb) {
    let (length, direction) = ((to - from).length(), (to - from).normalize_or_zero());
    let starts =
        std::iter::successors(Some(0.0_f32), |at| Some(at + 2.0 * DASH)).take_while(|at| *at < length);
    for start in starts.take(300) {
        let ends = [start, (start + DASH).min(length)].map(|at| from + direction * at);
        line(lines, ends, colour, [1.0, 1.0]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_grid_lies_on_the_table_and_every_label_can_be_written() {
        let lines = Lines::of(&View::default(), &Camera::default());
        assert!(lines.ground.len().is_multiple_of(2) && lines.ground.len() > 200);
        assert!(lines.over.is_empty());
        for character in "-1234 0xym".chars().filter(|character| *character != ' ') {
            assert!(!strokes(character).is_empty(), "{character}");
        }
    }

    #[test]
    fn a_position_out_of_reach_is_joined_to_the_tip_of_the_ghost() {
        let ghost = [90.0, 60.0, 70.0, 90.0, 90.0, 90.0, 0.0];
        let wish = Vec3::new(0.0, 600.0, 100.0);
        let view = View { targets: Some(ghost), unreachable: Some(wish), ..View::default() };
        let over = Lines::of(&view, &Camera::default()).over;
        let point = |end: &LineEnd| Vec3::new(end[0], end[1], end[2]);
        assert_eq!(point(over.first().expect("a line")), tip_of(ghost));
        assert!(point(over.last().expect("a line")).distance(wish) <= 2.0 * DASH);
    }
}
