//! The appearance of the arm: the meshes of its bodies, in the axes of their links, in mm.
//!
//! The places of the joints come from [`kinematics::geometry`]. Widths and thicknesses are estimates.

use kinematics::geometry::{
    BASE_HEIGHT, BASE_RADIUS, DISC_RADIUS, ELBOW_OFFSET, FINGER_AXIS, FINGER_BEND, FINGER_END, FOREARM,
    LEVER, REAR_ARM, SHOULDER_FORWARD, SHOULDER_HEIGHT, TOOL,
};

use crate::chain::Axes;
use crate::mesh::Finish::{Accent, Dark, Shell};
use crate::mesh::{Mesh, MeshAxis};

/// A rigid body of the arm.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Body {
    /// The base, which stands on the table.
    Base,
    /// Turned by joint 1.
    Turret,
    /// From the shoulder to the elbow, turned by joint 2.
    RearArm,
    /// The lever of the parallelogram at the shoulder, turned by joint 3.
    Lever,
    /// The rod of the parallelogram, from the lever to the forearm.
    Rod,
    /// From the elbow to the wrist, turned by joint 3.
    Forearm,
    /// Turned by joint 4.
    Wrist,
    /// Turned by joint 5.
    Hand,
    /// The disc and the palm of the claw, turned by joint 6.
    Disc,
    /// The finger of the claw on the side to which the y axis of the disc points, moved by joint 7.
    Finger,
    /// The opposite finger of the claw, moved by joint 7.
    OppositeFinger,
}

impl Body {
    /// All bodies, from the base to the claw.
    pub const ALL: [Self; 11] = [
        Self::Base,
        Self::Turret,
        Self::RearArm,
        Self::Lever,
        Self::Rod,
        Self::Forearm,
        Self::Wrist,
        Self::Hand,
        Self::Disc,
        Self::Finger,
        Self::OppositeFinger,
    ];

    /// The joint to which the body belongs, 1 to 7. The rod, which joints 2 and 3 move, belongs to joint 3. `None` for the base.
    #[must_use]
    pub const fn joint(self) -> Option<u8> {
        match self {
            Self::Base => None,
            Self::Turret => Some(1),
            Self::RearArm => Some(2),
            Self::Lever | Self::Rod | Self::Forearm => Some(3),
            Self::Wrist => Some(4),
            Self::Hand => Some(5),
            Self::Disc => Some(6),
            Self::Finger | Self::OppositeFinger => Some(7),
        }
    }

    /// The mesh of the body, in mm, in the axes that [`poses`](crate::poses) gives.
    #[must_use]
    pub fn mesh(self) -> Mesh {
        let mut mesh = Mesh::default();
        let add: fn(&mut Mesh) = match self {
            Self::Base => base,
            Self::Turret => turret,
            Self::RearArm => rear_arm,
            Self::Lever => lever,
            Self::Rod => rod,
            Self::Forearm => forearm,
            Self::Wrist => wrist,
            Self::Hand => hand,
            Self::Disc => |mesh| {
                disc(mesh);
                palm(mesh);
            },
            Self::Finger => |mesh| finger(mesh, 1.0),
            Self::OppositeFinger => |mesh| finger(mesh, -1.0),
        };
        add(&mut mesh);
        mesh
    }
}

const ORIGIN: Axes = [0.0; 3];
const ELBOW: Axes = [0.0, 0.0, REAR_ARM];
const SHOULDER: Axes = [SHOULDER_FORWARD, 0.0, SHOULDER_HEIGHT];
const LEVER_END: Axes = [-LEVER, 0.0, 0.0];

/// A point in the plane of the arm.
const fn at(x: f64, z: f64) -> Axes {
    [x, 0.0, z]
}

/// Adds a plate on the left and its mirror image on the right.
fn both_sides(mesh: &mut Mesh, circles: &[(Axes, f64)], [near, far]: [f64; 2]) {
    mesh.plate(Shell, MeshAxis::Y, circles, [near, far]);
    mesh.plate(Shell, MeshAxis::Y, circles, [-far, -near]);
}

/// Adds hubs on an axis, on the left and on the right.
fn hubs(mesh: &mut Mesh, centre: Axes, radius: f64, [near, far]: [f64; 2]) {
    mesh.cylinder(Accent, MeshAxis::Y, centre, radius, [near, far]);
    mesh.cylinder(Accent, MeshAxis::Y, centre, radius, [-far, -near]);
}

/// Adds a box with rounded edges along y.
fn rounded_box(mesh: &mut Mesh, finish: crate::Finish, [x0, x1]: [f64; 2], [z0, z1]: [f64; 2], width: f64) {
    let corners = [at(x0, z0), at(x1, z0), at(x1, z1), at(x0, z1)].map(|[x, y, z]| {
        let inward = |value: f64, low: f64, high: f64| value.clamp(low + 3.0, high - 3.0);
        ([inward(x, x0, x1), y, inward(z, z0, z1)], 3.0)
    });
    mesh.plate(finish, MeshAxis::Y, &corners, [-width / 2.0, width / 2.0]);
}

fn base(mesh: &mut Mesh) {
    let floor = -BASE_HEIGHT;
    mesh.cylinder(Dark, MeshAxis::Z, ORIGIN, BASE_RADIUS, [floor, floor + 8.0]);
    let profile =
        [[0.0, floor + 8.0], [66.0, floor + 8.0], [64.0, -16.0], [57.0, -6.0], [55.0, -5.0], [0.0, -5.0]];
    mesh.revolved(Shell, MeshAxis::Z, ORIGIN, &profile);
    mesh.cylinder(Dark, MeshAxis::Z, ORIGIN, 50.0, [-6.0, 0.0]);
}

fn turret(mesh: &mut Mesh) {
    mesh.cylinder(Accent, MeshAxis::Z, ORIGIN, 56.0, [0.0, 8.0]);
    mesh.cylinder(Shell, MeshAxis::Z, ORIGIN, 50.0, [7.0, 14.0]);
    let cheek = [(at(-26.0, 14.0), 8.0), (at(40.0, 14.0), 8.0), (SHOULDER, 20.0)];
    both_sides(mesh, &cheek, [31.0, 37.0]);
    let shoulder = [SHOULDER_FORWARD - 16.0, SHOULDER_FORWARD + 16.0];
    rounded_box(mesh, Dark, shoulder, [14.0, SHOULDER_HEIGHT - 20.0], 61.0);
}

fn rear_arm(mesh: &mut Mesh) {
    hubs(mesh, ORIGIN, 17.0, [37.0, 41.0]);
    mesh.cylinder(Dark, MeshAxis::Y, ORIGIN, 13.0, [-30.0, 30.0]);
    both_sides(mesh, &[(ORIGIN, 18.0), (ELBOW, 14.0)], [24.0, 30.0]);
    mesh.plate(Shell, MeshAxis::Y, &[(at(2.0, 44.0), 6.0), (at(2.0, 74.0), 6.0)], [-24.0, 24.0]);
}

fn lever(mesh: &mut Mesh) {
    mesh.plate(Accent, MeshAxis::Y, &[(ORIGIN, 12.0), (LEVER_END, 7.0)], [8.0, 13.0]);
}

fn rod(mesh: &mut Mesh) {
    mesh.plate(Dark, MeshAxis::Y, &[(ORIGIN, 5.0), (ELBOW, 5.0)], [13.0, 18.0]);
    mesh.cylinder(Shell, MeshAxis::Y, ORIGIN, 3.0, [7.0, 20.0]);
    mesh.cylinder(Shell, MeshAxis::Y, ELBOW, 3.0, [7.0, 20.0]);
}

fn forearm(mesh: &mut Mesh) {
    hubs(mesh, ORIGIN, 12.0, [30.0, 34.0]);
    mesh.cylinder(Dark, MeshAxis::Y, ORIGIN, 9.0, [-24.0, 24.0]);
    mesh.plate(
        Shell,
        MeshAxis::Y,
        &[(LEVER_END, 7.0), (ORIGIN, 14.0), (at(30.0, ELBOW_OFFSET), 12.0)],
        [6.0, 12.0],
    );
    mesh.plate(
        Shell,
        MeshAxis::Y,
        &[(ORIGIN, 15.0), (at(0.0, ELBOW_OFFSET), 15.0), (at(66.0, ELBOW_OFFSET), 13.0)],
        [-21.0, 6.0],
    );
    rounded_box(mesh, Shell, [-8.0, 74.0], [ELBOW_OFFSET - 14.0, ELBOW_OFFSET + 17.0], 38.0);
    let axis = [0.0, 0.0, ELBOW_OFFSET];
    mesh.cylinder(Shell, MeshAxis::X, axis, 13.0, [72.0, FOREARM - 48.0]);
    mesh.cylinder(Dark, MeshAxis::X, axis, 16.0, [FOREARM - 50.0, FOREARM - 26.0]);
}

fn wrist(mesh: &mut Mesh) {
    mesh.cylinder(Accent, MeshAxis::X, ORIGIN, 16.0, [-26.0, -18.0]);
    rounded_box(mesh, Shell, [-19.0, -11.0], [-11.0, 11.0], 38.0);
    both_sides(mesh, &[(at(-12.0, 0.0), 10.0), (ORIGIN, 10.0)], [14.0, 19.0]);
}

fn hand(mesh: &mut Mesh) {
    hubs(mesh, ORIGIN, 8.0, [19.0, 22.0]);
    rounded_box(mesh, Dark, [-9.0, 10.0], [-10.0, 10.0], 27.0);
    mesh.cylinder(Shell, MeshAxis::X, ORIGIN, 11.0, [9.0, TOOL - 5.0]);
}

/// Adds the disc, and a pin on its y axis that shows how joint 6 turns the disc.
fn disc(mesh: &mut Mesh) {
    mesh.cylinder(Accent, MeshAxis::X, ORIGIN, DISC_RADIUS, [-5.0, 0.0]);
    mesh.cylinder(Dark, MeshAxis::X, [0.0, DISC_RADIUS - 3.5, 0.0], 2.5, [-1.0, 3.0]);
}

/// Adds the palm, which carries the fingers.
fn palm(mesh: &mut Mesh) {
    let [ahead, aside] = FINGER_AXIS;
    let left = [ahead - 2.0, aside, 0.0];
    let right = [ahead - 2.0, -aside, 0.0];
    let foot = [([4.0, 8.0, 0.0], 4.0), ([4.0, -8.0, 0.0], 4.0)];
    mesh.plate(Dark, MeshAxis::Z, &[foot[0], foot[1], (left, 6.0), (right, 6.0)], [-6.0, 6.0]);
}

/// Adds a finger whose axis is at the origin: the left finger for a `side` of 1, the right finger for -1.
fn finger(mesh: &mut Mesh, side: f64) {
    let bone = |points: [[f64; 2]; 2], radii: [f64; 2]| {
        let [[x0, y0], [x1, y1]] = points;
        let [r0, r1] = radii;
        [([x0, side * y0, 0.0], r0), ([x1, side * y1, 0.0], r1)]
    };
    mesh.cylinder(Accent, MeshAxis::Z, ORIGIN, 5.5, [-9.0, 9.0]);
    mesh.plate(Accent, MeshAxis::Z, &bone([[0.0, 0.0], FINGER_BEND], [4.5, 4.0]), [-8.0, 8.0]);
    mesh.plate(Shell, MeshAxis::Z, &bone([FINGER_BEND, FINGER_END], [4.0, 2.5]), [-8.0, 8.0]);
}

/// The mesh of a link of the chain, in mm. The chain has neither lever, rod nor claw. `None`: the link has no shape.
pub(crate) fn of_link(name: &str) -> Option<Mesh> {
    let mut mesh = Mesh::default();
    let add: fn(&mut Mesh) = match name {
        "base_link" => base,
        "turret" => turret,
        "rear_arm" => rear_arm,
        "forearm" => forearm,
        "wrist" => wrist,
        "hand" => hand,
        "disc" => disc,
        _ => return None,
    };
    add(&mut mesh);
    Some(mesh)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_body_has_a_mesh_and_every_joint_a_body_with_its_accent() {
        for body in Body::ALL {
            let mesh = body.mesh();
            assert!(mesh.positions.len() >= 300, "{body:?}");
            assert_eq!(mesh.positions.len(), mesh.normals.len());
            assert_eq!(mesh.positions.len(), mesh.finishes.len());
        }
        for joint in 1..=7 {
            let accents = |body: &Body| body.joint() == Some(joint) && body.mesh().finishes.contains(&Accent);
            assert!(Body::ALL.iter().any(accents), "joint {joint}");
        }
    }

    #[test]
    fn the_base_stands_on_the_table_and_ends_at_the_top_plate() {
        let [low, high] = Body::Base.mesh().bounds();
        assert_eq!((f64::from(low[2]), high[2]), (-BASE_HEIGHT, 0.0));
        assert_eq!((f64::from(low[0]), f64::from(high[1])), (-BASE_RADIUS, BASE_RADIUS));
    }

    #[test]
    fn the_mesh_is_small_enough_for_software_rendering() {
        let triangles: usize = Body::ALL.iter().map(|body| body.mesh().positions.len() / 3).sum();
        assert!((2_000..12_000).contains(&triangles), "{triangles}");
    }
}
