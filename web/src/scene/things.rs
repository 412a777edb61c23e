//! Things and walls on the table: converts them to triangles with the colour of each face.

use arm_sim::scene::{Block, Form};
use arm_sim::world::{Object, World};
use glam::{Vec2, Vec3};
use kinematics::Vector;

use super::lines::LineEnd;
use super::theme::{Palette, Rgb};
use super::view::DrawnThing;

/// The number of corners of the outline of a cylinder.
const SIDES: u16 = 24;
/// A thing whose name begins with one of these words has this colour.
const NAMED: [(&str, Rgb); 6] = [
    ("red", Rgb(214, 60, 52)),
    ("green", Rgb(56, 158, 84)),
    ("blue", Rgb(52, 110, 214)),
    ("yellow", Rgb(232, 184, 40)),
    ("orange", Rgb(232, 128, 40)),
    ("white", Rgb(236, 238, 240)),
];
/// The direction to the light that shades the faces.
const LIGHT: Vec3 = Vec3::new(0.25, -0.45, 0.85);

/// Converts the walls and things of a room for the view.
#[must_use]
pub fn things(world: &World) -> Vec<DrawnThing> {
    let table = world.scene().table;
    let walls = world.scene().walls.iter().map(|wall| of_wall(wall, table));
    walls.chain(world.objects().iter().map(of_object)).collect()
}

fn of_wall(&Block { at: [x, y], size: [width, depth, height], ref name }: &Block, table: f64) -> DrawnThing {
    let half = |direction: Vec3, size: f64| direction * single(size / 2.0);
    DrawnThing {
        middle: vector(Vector::new(x, y, table + height / 2.0)),
        axes: [half(Vec3::X, width), half(Vec3::Y, depth), half(Vec3::Z, height)],
        is_round: false,
        named: named(name),
        is_wall: true,
    }
}

fn of_object(object: &Object) -> DrawnThing {
    let (is_round, [x, y, z]) = match object.item.form {
        Form::Cube { edge } => (false, [edge; 3]),
        Form::Cylinder { diameter, height } => (true, [diameter, diameter, height]),
    };
    let frame = &object.frame;
    let half = |axis: Vector<f64>, size: f64| vector(axis * (size / 2.0));
    DrawnThing {
        middle: vector(frame.origin),
        axes: [half(frame.x, x), half(frame.y, y), half(frame.z, z)],
        is_round,
        named: named(&object.item.name),
        is_wall: false,
    }
}

fn named(name: &str) -> Option<Rgb> {
    NAMED.iter().find(|(prefix, _)| name.starts_with(prefix)).map(|(_, colour)| *colour)
}

fn vector(Vector { x, y, z }: Vector<f64>) -> Vec3 {
    Vec3::from([x, y, z].map(single))
}

#[expect(clippy::cast_possible_truncation, reason = "a thousandth of a millimetre is not seen")]
const fn single(value: f64) -> f32 {
    value as f32
}

/// The triangles of the things: three corners each, counter-clockwise when seen from outside.
#[must_use]
pub fn triangles(things: &[DrawnThing], palette: &Palette) -> Vec<LineEnd> {
    let mut corners = Vec::new();
    for (thing, own) in things.iter().zip(palette.joints.iter().cycle()) {
        let colour = thing.named.unwrap_or(if thing.is_wall { palette.grid } else { *own });
        let outline = if thing.is_round { circle() } else { square() };
        add(&mut corners, thing, &outline, colour);
    }
    corners
}

fn square() -> Vec<Vec2> {
    [[1.0, -1.0], [1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0]].map(Vec2::from).to_vec()
}

fn circle() -> Vec<Vec2> {
    let angle = |side: u16| f32::from(side) * std::f32::consts::TAU / f32::from(SIDES);
    (0..SIDES).map(|side| Vec2::from_angle(angle(side))).collect()
}

/// Adds a prism with this outline, whose corners are in counter-clockwise order.
fn add(corners: &mut Vec<LineEnd>, thing: &DrawnThing, outline: &[Vec2], colour: Rgb) {
    let [x, y, z] = thing.axes;
    let at = |edge: Vec2, height: f32| thing.middle + x * edge.x + y * edge.y + z * height;
    let next = outline.iter().cycle().skip(1);
    for (&one, &other) in outline.iter().zip(next) {
        let [a, b, c, d] = [at(one, -1.0), at(other, -1.0), at(other, 1.0), at(one, 1.0)];
        face(corners, colour, &[[a, b, c], [a, c, d]]);
        face(corners, colour, &[[thing.middle + z, d, c], [thing.middle - z, b, a]]);
    }
}

fn face(corners: &mut Vec<LineEnd>, colour: Rgb, triangles: &[[Vec3; 3]]) {
    for [a, b, c] in triangles {
        let normal = (*b - *a).cross(*c - *a).normalize_or_zero();
        let brightness = 0.72 + 0.28 * normal.dot(LIGHT.normalize());
        let [red, green, blue] = colour.floats().map(|part| part * brightness);
        corners.extend([a, b, c].map(|&Vec3 { x, y, z }| [x, y, z, red, green, blue, 1.0]));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::theme::Theme;

    #[test]
    fn all_faces_look_outward() {
        let world = World::new(
            "cube red 30 40 0 200 30; cylinder can 40 60 90 80 200; wall w -100 200 10 50 40"
                .parse()
                .unwrap(),
        );
        let things = things(&world);
        assert_eq!(things.len(), 3);
        assert_eq!(things[1].middle, Vec3::new(0.0, 200.0, -45.0));
        for thing in things {
            let corners = triangles(&[thing], Theme::Light.palette());
            assert_eq!(corners.len(), if thing.is_round { 24 } else { 4 } * 4 * 3);
            for triangle in corners.chunks(3) {
                let [a, b, c] = [0, 1, 2].map(|index: usize| Vec3::from_slice(&triangle[index][..3]));
                let outward = (b - a).cross(c - a).dot((a + b + c) / 3.0 - thing.middle);
                assert!(outward > 0.0, "{thing:?}");
            }
        }
    }
}
