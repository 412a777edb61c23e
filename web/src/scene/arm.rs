//! The geometry of the arm: the triangles of its bodies, their positions, and the first body that a ray hits.

use arm_model::{Body, Mesh, poses};
use glam::{Affine3A, Mat3A, Vec3, Vec3A};
use kinematics::Vector;

use super::camera::Ray;

/// Angles of joints 1 to 7 in degrees, as in the registers.
pub type Angles = [f32; 7];

/// The number of bodies. The vertex shader of the arm has the same number as a literal.
pub const BODIES: usize = Body::ALL.len();

/// What a person can point at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ArmPart {
    /// The base, which no joint turns.
    Base,
    /// The part that this joint, 1 to 7, moves.
    Joint(u8),
    /// The marker of the tip.
    Tip,
}

impl ArmPart {
    /// The part to which a body belongs.
    #[must_use]
    pub const fn of(body: Body) -> Self {
        match body.joint() {
            None => Self::Base,
            Some(joint) => Self::Joint(joint),
        }
    }
}

/// The first point at which a ray hits the arm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// The body that the ray hits.
    pub body: Body,
    /// The point in the coordinates of the body, in mm.
    pub local: Vec3,
    /// The distance from the origin of the ray, in mm.
    pub distance: f32,
}

/// The meshes of all bodies.
#[derive(Clone, Debug)]
pub struct ArmMeshes {
    meshes: [(Body, Mesh); BODIES],
}

impl Default for ArmMeshes {
    fn default() -> Self {
        Self { meshes: Body::ALL.map(|body| (body, body.mesh())) }
    }
}

impl ArmMeshes {
    /// Each body with its mesh, in the order of [`Body::ALL`].
    #[must_use]
    pub const fn meshes(&self) -> &[(Body, Mesh); BODIES] {
        &self.meshes
    }

    /// The body of an arm with these angles that a ray hits first; `None` if the ray misses the arm.
    #[must_use]
    pub fn pick(&self, angles: Angles, ray: Ray) -> Option<Hit> {
        let hits =
            transforms(angles).into_iter().zip(&self.meshes).filter_map(|((body, transform), (_, mesh))| {
                let inverse = transform.inverse();
                let local = Ray {
                    origin: inverse.transform_point3(ray.origin),
                    direction: inverse.transform_vector3(ray.direction),
                };
                let distance = first_triangle(mesh, local)?;
                Some(Hit { body, local: local.origin + local.direction * distance, distance })
            });
        hits.min_by(|one, other| one.distance.total_cmp(&other.distance))
    }
}

/// For each body, the transform from the coordinates of the body to the coordinates of the arm, in mm.
#[must_use]
pub fn transforms(angles: Angles) -> [(Body, Affine3A); BODIES] {
    poses(angles.map(f64::from)).map(|(body, pose)| {
        let axes = [pose.x, pose.y, pose.z].map(|axis| Vec3A::from(from_vector(axis)));
        let [x, y, z] = axes;
        let matrix3 = Mat3A::from_cols(x, y, z);
        (body, Affine3A { matrix3, translation: Vec3A::from(from_vector(pose.origin)) })
    })
}

/// Converts a point from the coordinates of a body to those of the arm, in mm.
#[must_use]
pub fn point_of(angles: Angles, body: Body, local: Vec3) -> Vec3 {
    let found = transforms(angles).into_iter().find(|(other, _)| *other == body);
    found.map_or(local, |(_, transform)| transform.transform_point3(local))
}

/// The tip: where the axis of joint 6 meets the outer face of the disc, in mm.
#[must_use]
pub fn tip_of(angles: Angles) -> Vec3 {
    point_of(angles, Body::Disc, Vec3::ZERO)
}

/// Converts a vector of `kinematics` to single precision.
#[must_use]
#[expect(clippy::cast_possible_truncation, reason = "rounds to the nearest f32")]
pub const fn from_vector(vector: Vector<f64>) -> Vec3 {
    Vec3::new(vector.x as f32, vector.y as f32, vector.z as f32)
}

/// Converts a vector to the double precision of `kinematics`.
#[must_use]
pub fn to_vector(vector: Vec3) -> Vector<f64> {
    let [x, y, z] = vector.to_array().map(f64::from);
    Vector::new(x, y, z)
}

/// The distance along a ray to the first front-facing triangle; `None` if it hits none.
fn first_triangle(mesh: &Mesh, ray: Ray) -> Option<f32> {
    let triangles = mesh.positions.as_chunks::<3>().0;
    let distances = triangles.iter().filter_map(|corners| distance_to(corners.map(Vec3::from), ray));
    distances.min_by(f32::total_cmp)
}

/// The distance along a ray to a front-facing triangle, by the algorithm of Möller and Trumbore; `None` if the ray misses it.
fn distance_to([a, b, c]: [Vec3; 3], ray: Ray) -> Option<f32> {
    let (one, other) = (b - a, c - a);
    let across = ray.direction.cross(other);
    let facing = one.dot(across);
    if facing < 1e-6 {
        return None;
    }
    let from = ray.origin - a;
    let u = from.dot(across) / facing;
    let along = from.cross(one);
    let v = ray.direction.dot(along) / facing;
    let distance = other.dot(along) / facing;
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && distance > 0.0).then_some(distance)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::camera::Camera;

    const POSE: Angles = [90.0, 115.0, 65.0, 90.0, 90.0, 90.0, 80.0];

    #[test]
    fn a_ray_from_above_meets_the_forearm_and_one_from_the_side_the_rear_arm() {
        let arm = ArmMeshes::default();
        let down = |x, y| Ray { origin: Vec3::new(x, y, 900.0), direction: Vec3::NEG_Z };
        let hit = arm.pick(POSE, down(0.0, 80.0)).expect("a body");
        assert_eq!((hit.body, ArmPart::of(hit.body)), (Body::Forearm, ArmPart::Joint(3)));
        assert_eq!(arm.pick(POSE, down(70.0, 0.0)).map(|hit| hit.body), Some(Body::Base));
        assert_eq!(arm.pick(POSE, down(300.0, 0.0)), None);
        let side = Ray { origin: Vec3::new(900.0, 5.0, 130.0), direction: Vec3::NEG_X };
        assert_eq!(arm.pick(POSE, side).map(|hit| hit.body), Some(Body::RearArm));
    }

    #[test]
    fn the_point_of_a_hit_is_on_the_ray() {
        let (arm, camera) = (ArmMeshes::default(), Camera::default());
        let mut hits = 0;
        for step in 0..40 {
            let pixel = glam::Vec2::new(480.0 + 8.0 * step as f32, 300.0 + 2.0 * step as f32);
            let ray = camera.ray(pixel);
            let Some(hit) = arm.pick(POSE, ray) else { continue };
            hits += 1;
            let point = point_of(POSE, hit.body, hit.local);
            assert!((point - (ray.origin + ray.direction * hit.distance)).length() < 0.1);
            assert!((camera.project(point).expect("in front") - pixel).length() < 0.1);
        }
        assert!(hits > 5, "{hits}");
    }

    #[test]
    fn the_tip_is_that_of_the_kinematics() {
        // A value from the tables of the maker's forward kinematics.
        let tip = tip_of([50.0, 80.0, 50.0, 50.0, 50.0, 50.0, 0.0]);
        assert!((tip - Vec3::new(167.30, 184.94, 283.34)).length() < 0.01, "{tip}");
    }
}
