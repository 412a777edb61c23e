//! Meshes of cylinders: triangles with normals.

use crate::chain::{Axes, Solid};

/// Sides of a cylinder.
const SIDES: u32 = 24;

/// Triangles, three corners each. Each corner has a position and a normal.
#[derive(Clone, Debug, Default)]
pub(crate) struct Mesh {
    pub(crate) positions: Vec<[f32; 3]>,
    pub(crate) normals: Vec<[f32; 3]>,
}

impl Mesh {
    /// All shapes of a link.
    pub(crate) fn of(solids: &[Solid]) -> Self {
        let mut mesh = Self::default();
        for solid in solids {
            mesh.add(solid);
        }
        mesh
    }

    /// The smallest and the largest coordinates.
    pub(crate) fn bounds(&self) -> [[f32; 3]; 2] {
        let extreme = |choose: fn(f32, f32) -> f32| {
            let choose =
                |[x, y, z]: [f32; 3], &[u, v, w]: &[f32; 3]| [choose(x, u), choose(y, v), choose(z, w)];
            let first = self.positions.first().copied().unwrap_or_default();
            self.positions.iter().fold(first, choose)
        };
        [extreme(f32::min), extreme(f32::max)]
    }

    fn add(&mut self, solid: &Solid) {
        let along = unit(minus(solid.to, solid.from));
        let across = unit(cross(along, if along[0].abs() < 0.9 { [1.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0] }));
        let third = cross(along, across);
        let spoke = |side: u32| {
            let (sine, cosine) = (f64::from(side) * std::f64::consts::TAU / f64::from(SIDES)).sin_cos();
            plus(scaled(across, cosine), scaled(third, sine))
        };
        for side in 0..SIDES {
            let spokes = [spoke(side), spoke(side + 1)];
            let rim = |end: Axes| spokes.map(|spoke| plus(end, scaled(spoke, solid.radius)));
            let ([a, b], [c, d]) = (rim(solid.from), rim(solid.to));
            let [one, other] = spokes;
            self.triangle([(a, one), (b, other), (d, other)]);
            self.triangle([(a, one), (d, other), (c, one)]);
            let back = scaled(along, -1.0);
            self.triangle([(solid.from, back), (b, back), (a, back)]);
            self.triangle([(solid.to, along), (c, along), (d, along)]);
        }
    }

    fn triangle(&mut self, corners: [(Axes, Axes); 3]) {
        for (position, normal) in corners {
            self.positions.push(position.map(single));
            self.normals.push(normal.map(single));
        }
    }
}

#[expect(clippy::cast_possible_truncation, reason = "rounds to the nearest f32, which glTF demands")]
fn single(value: f64) -> f32 {
    value as f32
}

fn plus([x, y, z]: Axes, [u, v, w]: Axes) -> Axes {
    [x + u, y + v, z + w]
}

fn minus(one: Axes, other: Axes) -> Axes {
    plus(one, scaled(other, -1.0))
}

fn scaled(axes: Axes, factor: f64) -> Axes {
    axes.map(|component| component * factor)
}

fn cross([x, y, z]: Axes, [u, v, w]: Axes) -> Axes {
    [y * w - z * v, z * u - x * w, x * v - y * u]
}

fn unit(axes: Axes) -> Axes {
    let [x, y, z] = axes;
    scaled(axes, 1.0 / x.hypot(y).hypot(z))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cylinder_is_closed_and_faces_outward() {
        let solid = Solid { from: [0.0; 3], to: [0.0, 0.0, 2.0], radius: 1.0 };
        let mesh = Mesh::of(&[solid]);
        assert_eq!(mesh.positions.len(), 24 * 4 * 3);
        // The sum of the tetrahedra to the origin is the volume, if all triangles face outward.
        let corner = |index: usize| mesh.positions[index].map(f64::from);
        let volume: f64 = (0..mesh.positions.len() / 3)
            .map(|triangle| {
                let [a, b, c] = [0, 1, 2].map(|place| corner(triangle * 3 + place));
                let [x, y, z] = cross(b, c);
                (a[0] * x + a[1] * y + a[2] * z) / 6.0
            })
            .sum();
        assert!((volume - std::f64::consts::TAU).abs() < 0.1, "{volume}");
        let [low, high] = mesh.bounds();
        assert!(low[2] == 0.0 && high[2] == 2.0 && low[0] < -0.99 && high[1] > 0.99);
    }
}
