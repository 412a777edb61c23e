//! Triangles of simple solids: solids of revolution, and plates with a convex outline. Lengths are millimetres.

use std::f64::consts::TAU;

use crate::chain::Axes;

/// Number of sides of the polygon that replaces a circle.
const SIDES: u32 = 20;
/// The width of the chamfer at the edges of cylinders and plates, in mm.
const CHAMFER: f64 = 1.2;

/// The kind of part that a triangle belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Finish {
    /// The structure.
    Shell,
    /// A servo or another dark part.
    Dark,
    /// A hub or another part that marks a joint.
    Accent,
}

/// Triangles, three corners each. The three lists have one entry for each corner.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Position of each corner, in mm.
    pub positions: Vec<[f32; 3]>,
    /// Direction out of the solid at each corner, of length 1.
    pub normals: Vec<[f32; 3]>,
    /// The kind of part that each corner belongs to; a renderer chooses the colour by it.
    pub finishes: Vec<Finish>,
}

/// The axis of a solid of revolution, or the direction of a plate's thickness.
#[derive(Clone, Copy, Debug)]
pub(crate) enum MeshAxis {
    X,
    Y,
    Z,
}

impl MeshAxis {
    /// Converts the two coordinates across the axis and the one along the axis to x, y, z.
    fn xyz(self, [u, v, w]: Axes) -> Axes {
        match self {
            Self::X => [w, u, v],
            Self::Y => [v, w, u],
            Self::Z => [u, v, w],
        }
    }

    /// The two coordinates across the axis, in the order of [`MeshAxis::xyz`].
    fn across(self, [x, y, z]: Axes) -> [f64; 2] {
        match self {
            Self::X => [y, z],
            Self::Y => [z, x],
            Self::Z => [x, y],
        }
    }
}

/// A point of an outline, and its direction out of the solid.
#[derive(Clone, Copy, Debug)]
struct OutlinePoint {
    at: [f64; 2],
    normal: [f64; 2],
}

impl OutlinePoint {
    fn on_circle([u, v]: [f64; 2], radius: f64, side: u32) -> Self {
        let (sine, cosine) = (f64::from(side) * TAU / f64::from(SIDES)).sin_cos();
        Self { at: [u + radius * cosine, v + radius * sine], normal: [cosine, sine] }
    }

    fn inset(self, by: f64) -> [f64; 2] {
        let ([u, v], [nu, nv]) = (self.at, self.normal);
        [u - nu * by, v - nv * by]
    }
}

/// A corner of a triangle: position and normal.
type Corner = (Axes, Axes);

impl Mesh {
    /// The smallest and the largest coordinates, in mm.
    #[must_use]
    pub fn bounds(&self) -> [[f32; 3]; 2] {
        let extreme = |choose: fn(f32, f32) -> f32| {
            let choose =
                |[x, y, z]: [f32; 3], &[u, v, w]: &[f32; 3]| [choose(x, u), choose(y, v), choose(z, w)];
            let first = self.positions.first().copied().unwrap_or_default();
            self.positions.iter().fold(first, choose)
        };
        [extreme(f32::min), extreme(f32::max)]
    }

    /// Adds a cylinder about a line along `axis` through `centre`, between two coordinates along the axis.
    pub(crate) fn cylinder(
        &mut self,
        finish: Finish,
        axis: MeshAxis,
        centre: Axes,
        radius: f64,
        ends: [f64; 2],
    ) {
        let ([low, high], rim) = (ends, radius - CHAMFER);
        let profile = [
            [0.0, low],
            [rim, low],
            [radius, low + CHAMFER],
            [radius, high - CHAMFER],
            [rim, high],
            [0.0, high],
        ];
        self.revolved(finish, axis, centre, &profile);
    }

    /// Adds a solid of revolution about a line along `axis` through `centre`. The profile is points of radius and
    /// coordinate along the axis, from the low end to the high one; it begins and ends on the axis.
    pub(crate) fn revolved(&mut self, finish: Finish, axis: MeshAxis, centre: Axes, profile: &[[f64; 2]]) {
        let centre = axis.across(centre);
        for pair in profile.windows(2) {
            let &[[radius, low], [end_radius, high]] = pair else { continue };
            let [along, out] = unit([end_radius - radius, high - low]);
            for side in 0..SIDES {
                let corner = |side, radius, w| {
                    let OutlinePoint { at: [u, v], normal: [nu, nv] } =
                        OutlinePoint::on_circle(centre, radius, side);
                    (axis.xyz([u, v, w]), axis.xyz([nu * out, nv * out, -along]))
                };
                let (a, b) = (corner(side, radius, low), corner(side + 1, radius, low));
                let (c, d) = (corner(side + 1, end_radius, high), corner(side, end_radius, high));
                if radius > 0.0 {
                    self.triangle(finish, [a, b, c]);
                }
                if end_radius > 0.0 {
                    self.triangle(finish, [a, c, d]);
                }
            }
        }
    }

    /// Adds a plate: the convex hull of circles (a point in the plane across `axis` and a radius), between two
    /// coordinates along the axis. Radii must be larger than the chamfer of 1.2 mm.
    pub(crate) fn plate(&mut self, finish: Finish, axis: MeshAxis, circles: &[(Axes, f64)], ends: [f64; 2]) {
        let outline = hull(circles.iter().flat_map(|&(centre, radius)| {
            let centre = axis.across(centre);
            (0..SIDES).map(move |side| OutlinePoint::on_circle(centre, radius, side))
        }));
        let [low, high] = ends;
        let (bottom, top) = ([CHAMFER, low], [CHAMFER, high]);
        let (above, below) = ([0.0, low + CHAMFER], [0.0, high - CHAMFER]);
        let Some(&first) = outline.first() else { return };
        for (&one, &other) in outline.iter().zip(outline.iter().cycle().skip(1)) {
            for (tilt, from, to) in [(-1.0, bottom, above), (0.0, above, below), (1.0, below, top)] {
                let corner = |point: OutlinePoint, [inset, w]: [f64; 2]| {
                    let ([u, v], [nu, nv], length) = (point.inset(inset), point.normal, 1.0_f64.hypot(tilt));
                    (axis.xyz([u, v, w]), axis.xyz([nu / length, nv / length, tilt / length]))
                };
                self.triangle(finish, [corner(one, from), corner(other, from), corner(other, to)]);
                self.triangle(finish, [corner(one, from), corner(other, to), corner(one, to)]);
            }
            let cap = |point: OutlinePoint, w, up| {
                let [u, v] = point.inset(CHAMFER);
                (axis.xyz([u, v, w]), axis.xyz([0.0, 0.0, up]))
            };
            self.triangle(finish, [first, one, other].map(|point| cap(point, high, 1.0)));
            self.triangle(finish, [first, other, one].map(|point| cap(point, low, -1.0)));
        }
    }

    fn triangle(&mut self, finish: Finish, corners: [Corner; 3]) {
        for (position, normal) in corners {
            self.positions.push(position.map(single));
            self.normals.push(normal.map(single));
            self.finishes.push(finish);
        }
    }
}

/// The convex hull of points, anticlockwise (Andrew's monotone chain).
fn hull(points: impl Iterator<Item = OutlinePoint>) -> Vec<OutlinePoint> {
    let mut sorted: Vec<OutlinePoint> = points.collect();
    sorted.sort_by(|one, other| one.at.partial_cmp(&other.at).unwrap_or(std::cmp::Ordering::Equal));
    let mut lower = half_hull(sorted.iter().copied());
    let upper = half_hull(sorted.iter().rev().copied());
    lower.extend(upper);
    lower
}

/// One side of the hull of sorted points. The last point is left out, because the other side begins with it.
fn half_hull(points: impl Iterator<Item = OutlinePoint>) -> Vec<OutlinePoint> {
    let mut side: Vec<OutlinePoint> = Vec::new();
    for point in points {
        while let [.., before, last] = side.as_slice() {
            if turn(before.at, last.at, point.at) > 1e-9 {
                break;
            }
            side.pop();
        }
        side.push(point);
    }
    side.pop();
    side
}

/// Twice the area of a triangle; positive if the points turn to the left.
fn turn([a, b]: [f64; 2], [c, d]: [f64; 2], [e, f]: [f64; 2]) -> f64 {
    (c - a) * (f - b) - (d - b) * (e - a)
}

fn unit([u, v]: [f64; 2]) -> [f64; 2] {
    let length = u.hypot(v);
    [u / length, v / length]
}

#[expect(clippy::cast_possible_truncation, reason = "rounds to the nearest f32, which glTF demands")]
fn single(value: f64) -> f32 {
    value as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The sum of the signed tetrahedra between the triangles and the origin. It is the volume if the solid is closed and all
    /// triangles face outward.
    fn volume(mesh: &Mesh) -> f64 {
        mesh.positions
            .chunks(3)
            .map(|corners| {
                let [a, b, c] = [0, 1, 2].map(|place| corners[place].map(f64::from));
                let cross = [b[1] * c[2] - b[2] * c[1], b[2] * c[0] - b[0] * c[2], b[0] * c[1] - b[1] * c[0]];
                (a[0] * cross[0] + a[1] * cross[1] + a[2] * cross[2]) / 6.0
            })
            .sum()
    }

    #[test]
    fn solids_are_closed_and_face_outward() {
        // The area of a polygon of 20 sides in a circle of radius 1.
        let circle = 10.0 * (TAU / 20.0).sin();
        for axis in [MeshAxis::X, MeshAxis::Y, MeshAxis::Z] {
            let mut cylinder = Mesh::default();
            cylinder.cylinder(Finish::Shell, axis, [3.0, 4.0, 5.0], 30.0, [-10.0, 40.0]);
            let full = circle * 900.0 * 50.0;
            assert!((volume(&cylinder) / full - 1.0).abs() < 0.01, "{axis:?}: {}", volume(&cylinder));
            let mut plate = Mesh::default();
            let ends = [(axis.xyz([0.0, 0.0, 0.0]), 20.0), (axis.xyz([100.0, 0.0, 0.0]), 20.0)];
            plate.plate(Finish::Dark, axis, &ends, [5.0, 35.0]);
            let full = (circle * 400.0 + 4_000.0) * 30.0;
            assert!((volume(&plate) / full - 1.0).abs() < 0.02, "{axis:?}: {} {full}", volume(&plate));
        }
    }

    #[test]
    fn normals_have_length_1_and_the_side_of_their_triangle() {
        let mut mesh = Mesh::default();
        mesh.cylinder(Finish::Accent, MeshAxis::X, [0.0; 3], 10.0, [0.0, 9.0]);
        mesh.plate(Finish::Shell, MeshAxis::Y, &[([0.0; 3], 5.0), ([30.0, 0.0, 9.0], 8.0)], [2.0, 6.0]);
        for (corners, normals) in mesh.positions.chunks(3).zip(mesh.normals.chunks(3)) {
            let side = |to: usize| [0, 1, 2].map(|axis| corners[to][axis] - corners[0][axis]);
            let (a, b) = (side(1), side(2));
            let cross = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
            for normal in normals {
                let length: f32 = normal.iter().map(|part| part * part).sum();
                assert!((length - 1.0).abs() < 1e-5, "{normal:?}");
                let dot: f32 = cross.iter().zip(normal).map(|(one, other)| one * other).sum();
                assert!(dot > -1e-6, "{corners:?} {normal:?}");
            }
        }
    }
}
