//! Parsers of other projects read the URDF and the glTF. The results are compared with `kinematics`: the URDF in random poses,
//! the glTF in the straight pose. Of the MJCF only a part of the text is checked.

#![allow(clippy::expect_used, clippy::indexing_slicing, clippy::panic, clippy::unwrap_used)] // A panic is a failed test.

use std::collections::HashMap;

use arm_model::{JOINT_NAMES, TIP, joint_angles, link_transforms};
use kinematics::limits::check_arm;
use kinematics::{Vector, forward};
use urdf_rs::{JointType, Robot};

/// A transform: three columns of a rotation, and a translation.
type Pose = ([Vector<f64>; 3], Vector<f64>);

fn turned(([x, y, z], _): Pose, vector: [f64; 3]) -> Vector<f64> {
    x * vector[0] + y * vector[1] + z * vector[2]
}

/// A rotation about an axis, as columns.
fn rotation(axis: [f64; 3], angle: f64) -> [[f64; 3]; 3] {
    let [x, y, z] = axis;
    let (s, c) = angle.sin_cos();
    let t = 1.0 - c;
    [
        [t * x * x + c, t * x * y + s * z, t * x * z - s * y],
        [t * x * y - s * z, t * y * y + c, t * y * z + s * x],
        [t * x * z + s * y, t * y * z - s * x, t * z * z + c],
    ]
}

/// The poses of all links, with the joints at these angles.
fn urdf_poses(robot: &Robot, angles: &HashMap<String, f64>) -> HashMap<String, Pose> {
    let zero = Vector::new(0.0, 0.0, 0.0);
    let axes = [Vector::new(1.0, 0.0, 0.0), Vector::new(0.0, 1.0, 0.0), Vector::new(0.0, 0.0, 1.0)];
    let mut poses = HashMap::from([("base_link".to_owned(), (axes, zero))]);
    for joint in &robot.joints {
        let parent = poses[&joint.parent.link];
        assert_eq!(joint.origin.rpy.0, [0.0; 3]);
        let origin = parent.1 + turned(parent, joint.origin.xyz.0);
        let angle = match &joint.mimic {
            Some(mimic) => angles[&mimic.joint] * mimic.multiplier.unwrap() + mimic.offset.unwrap(),
            None => angles.get(&joint.name).copied().unwrap_or_default(),
        };
        let columns = rotation(joint.axis.xyz.0, angle);
        let columns = if joint.joint_type == JointType::Fixed {
            parent.0
        } else {
            columns.map(|column| turned(parent, column))
        };
        poses.insert(joint.child.link.clone(), (columns, origin));
    }
    poses
}

/// The poses computed from the transforms of the links.
fn transformed_poses(angles: [f64; 6]) -> HashMap<&'static str, Pose> {
    let zero = Vector::new(0.0, 0.0, 0.0);
    let axes = [Vector::new(1.0, 0.0, 0.0), Vector::new(0.0, 1.0, 0.0), Vector::new(0.0, 0.0, 1.0)];
    let mut poses = HashMap::from([("base_link", (axes, zero))]);
    for link in link_transforms(angles) {
        let parent = poses[link.parent];
        let [x, y, z, w] = link.rotation;
        let sine = (x * x + y * y + z * z).sqrt();
        let axis = if sine == 0.0 { [0.0, 0.0, 1.0] } else { [x, y, z].map(|part| part / sine) };
        let columns = rotation(axis, 2.0 * sine.atan2(w)).map(|column| turned(parent, column));
        poses.insert(link.child, (columns, parent.1 + turned(parent, link.translation)));
    }
    poses
}

/// Converts from millimetres with x to the right and y forward to metres with x forward and y to the left.
fn rep_103(point: Vector<f64>) -> Vector<f64> {
    Vector::new(point.y, -point.x, point.z) * 0.001
}

#[test]
fn the_urdf_has_the_forward_kinematics_of_the_arm() {
    let robot = urdf_rs::read_from_string(&arm_model::urdf().expect("text")).expect("URDF");
    let mut random = fastrand::Rng::with_seed(11);
    let mut poses = 0;
    while poses < 2_000 {
        let degrees = [(); 6].map(|()| random.f64() * 180.0);
        if check_arm(degrees).is_err() {
            continue;
        }
        poses += 1;
        let names = JOINT_NAMES.map(str::to_owned).into_iter();
        let angles: HashMap<String, f64> = names.zip(joint_angles(degrees)).collect();
        let found = urdf_poses(&robot, &angles);
        let transformed = transformed_poses(joint_angles(degrees));
        assert_eq!(transformed.len(), found.len());
        for (link, (columns, origin)) in transformed {
            let (expected, place) = found[link];
            assert!((origin - place).length() < 1e-9, "{link} at {degrees:?}");
            let turned = columns.into_iter().zip(expected).map(|(one, other)| (one - other).length());
            assert!(turned.into_iter().all(|apart| apart < 1e-9), "{link} at {degrees:?}");
        }
        let frames = forward(degrees);
        let (hand, arm) = (frames.hand, frames.arm);
        let points = [
            ("rear_arm", arm.shoulder),
            ("forearm", arm.elbow),
            ("hand", arm.wrist),
            (TIP, hand.tip),
            ("disc_edge", hand.disc_edge),
        ];
        for (link, point) in points {
            assert!((found[link].1 - rep_103(point)).length() < 1e-9, "{link} at {degrees:?}");
        }
        assert!((found[TIP].0[0] - rep_103(hand.tool) * 1000.0).length() < 1e-9, "the tool is x of the tip");
    }
}

#[test]
fn the_urdf_has_the_limits_of_the_joints() {
    let robot = urdf_rs::read_from_string(&arm_model::urdf().expect("text")).expect("URDF");
    for (place, name) in JOINT_NAMES.into_iter().enumerate() {
        let joint = robot.joints.iter().find(|joint| joint.name == name).expect("a joint");
        for (degrees, limit) in [(0.0, joint.limit.lower), (180.0, joint.limit.upper)] {
            assert!((joint_angles([degrees; 6])[place] - limit).abs() < 1e-9, "{name}");
        }
    }
    let elbow = robot.joints.iter().find(|joint| joint.name == "elbow").expect("an elbow");
    assert_eq!(elbow.mimic.as_ref().map(|mimic| mimic.joint.as_str()), Some("joint_2"));
}

#[test]
fn the_text_says_that_the_elbow_is_computed() {
    let urdf = arm_model::urdf().expect("text");
    assert!(urdf.contains("`elbow` is computed"), "{urdf}");
    assert!(
        arm_model::mjcf()
            .expect("text")
            .contains("<connect name=\"parallelogram\" body1=\"rod\" body2=\"forearm\"")
    );
}

#[test]
fn the_glb_has_the_arm_in_the_straight_pose() {
    let bytes = arm_model::glb().expect("bytes");
    let file = gltf::Gltf::from_slice(&bytes).expect("glTF");
    let root = file.default_scene().expect("a scene").nodes().next().expect("a node");
    // Translations add up: in the straight pose all links have the axes of the base.
    let mut names = HashMap::new();
    let mut open: Vec<(gltf::Node, [f64; 3])> = root.children().map(|node| (node, [0.0; 3])).collect();
    while let Some((node, before)) = open.pop() {
        let (translation, rotation, _) = node.transform().decomposed();
        assert_eq!(rotation, [0.0, 0.0, 0.0, 1.0]);
        let at = [0, 1, 2].map(|axis| before[axis] + f64::from(translation[axis]));
        names.insert(node.name().expect("a name").to_owned(), at);
        open.extend(node.children().map(|child| (child, at)));
    }
    let frames = forward(arm_model::ZERO_DEGREES);
    for (link, point) in
        [("forearm", frames.arm.elbow), (TIP, frames.hand.tip), ("disc_edge", frames.hand.disc_edge)]
    {
        let [x, y, z] = names[link];
        assert!((Vector::new(x, y, z) - rep_103(point)).length() < 1e-6, "{link}");
    }
    // The root turns forward (x) to z, left (y) to x and up (z) to y.
    let [i, j, k, w] = root.transform().decomposed().1.map(f64::from);
    let axis = 1.0 / 3.0_f64.sqrt();
    let columns = rotation([axis; 3], -std::f64::consts::TAU / 3.0);
    assert!(i == -0.5 && j == i && k == i && w == 0.5);
    assert!((columns[0][2] - 1.0).abs() < 1e-9 && (columns[1][0] - 1.0).abs() < 1e-9);
    assert_eq!(file.meshes().count(), 7);
}
