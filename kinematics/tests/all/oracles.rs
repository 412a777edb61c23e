//! Golden poses, computed with the maker's published kinematics in double precision.
//!
//! The tables hold angles to 0.001 degrees and positions to 0.01 mm. Angles may differ from them by 0.001 degrees, and
//! positions by 0.005 mm, half of the last digit.

use kinematics::{Float, NoSolution, Vector, forward, ik5, ik6, ik7};

type Triple = [f64; 3];

const UP: Triple = [0.0, 0.0, 1.0];
const DOWN: Triple = [0.0, 0.0, -1.0];
const FORWARD: Triple = [0.0, 1.0, 0.0];

fn vector<F: Float>([x, y, z]: Triple) -> Vector<F> {
    Vector::new(F::of(x), F::of(y), F::of(z))
}

fn assert_near<F: Float + Into<f64>, const N: usize>(
    found: [F; N],
    wanted: [f64; N],
    tolerance: f64,
    what: &str,
) {
    let found = found.map(Into::into);
    let is_near = found.iter().zip(wanted).all(|(found, wanted)| (found - wanted).abs() <= tolerance);
    assert!(is_near, "{what}: {found:?} is not {wanted:?}");
}

/// Tip, direction of the tool, T1 to T5.
const IK6: [(Triple, Triple, [f64; 5]); 16] = [
    ([-50.0, 185.0, 50.0], DOWN, [105.124, 88.229, 109.746, 90.000, 135.254]),
    ([0.0, 250.0, 100.0], DOWN, [90.000, 74.362, 91.926, 90.000, 153.074]),
    ([-125.0, 220.0, 35.0], DOWN, [119.605, 58.340, 108.741, 90.000, 136.259]),
    ([-40.0, 130.0, 35.0], DOWN, [107.103, 113.504, 111.614, 90.000, 133.387]),
    ([-26.0, 212.0, 35.0], DOWN, [96.992, 73.540, 113.508, 90.000, 131.492]),
    ([-28.0, 323.0, 35.0], DOWN, [94.954, 26.338, 92.744, 90.000, 152.256]),
    ([80.0, 203.0, 35.0], DOWN, [68.491, 71.729, 113.077, 90.000, 131.923]),
    ([-140.0, 105.0, 15.0], DOWN, [143.130, 80.569, 123.149, 90.000, 121.851]),
    ([0.0, 200.0, 40.0], DOWN, [90.000, 80.879, 112.900, 90.000, 132.100]),
    ([120.0, 220.0, 160.0], [1.0, 2.0, -1.0], [61.207, 88.902, 79.446, 78.059, 99.875]),
    ([0.0, 150.0, 150.0], [0.0, 1.0, -1.0], [90.000, 141.980, 67.169, 90.000, 132.831]),
    ([200.0, 200.0, 100.0], [1.0, 1.0, -1.0], [45.000, 66.286, 93.087, 90.000, 97.177]),
    ([-150.0, 150.0, 200.0], [-1.0, 1.0, 1.0], [135.000, 107.264, 72.768, 90.000, 46.967]),
    ([-200.0, 100.0, 90.0], [-2.0, 1.0, -2.0], [153.435, 90.672, 98.758, 90.000, 98.052]),
    ([0.0, 340.0, 140.0], FORWARD, [90.000, 42.333, 76.568, 90.000, 78.432]),
    ([0.0, 60.0, 300.0], FORWARD, [90.000, 150.081, 16.289, 90.000, 138.711]),
];

/// Wrist, T1 to T3.
const IK5: [(Triple, Triple); 6] = [
    ([100.0, 200.0, 150.0], [63.435, 90.382, 85.029]),
    ([-120.0, 180.0, 60.0], [123.690, 73.322, 112.497]),
    ([0.0, 227.0, 219.0], [90.000, 90.435, 65.143]),
    ([-150.0, 120.0, 250.0], [141.340, 103.715, 55.050]),
    ([60.0, 250.0, 250.0], [76.504, 71.862, 54.287]),
    ([200.0, 0.0, 120.0], [0.000, 97.386, 93.733]),
];

/// Tip, direction of the tool, direction of the disc, T1 to T6.
const IK7: [(Triple, Triple, Triple, [f64; 6]); 5] = [
    ([0.0, 250.0, 100.0], DOWN, FORWARD, [90.000, 74.362, 91.926, 90.000, 153.074, 0.000]),
    ([0.0, 250.0, 100.0], DOWN, [-1.0, 1.0, 0.0], [90.000, 74.362, 91.926, 90.000, 153.074, 45.000]),
    ([-50.0, 185.0, 50.0], DOWN, [3.0, 4.0, 0.0], [105.124, 88.229, 109.746, 90.000, 135.254, 128.006]),
    ([150.0, 150.0, 80.0], DOWN, [1.0, 1.0, 0.0], [45.000, 87.571, 99.533, 90.000, 145.467, 0.000]),
    ([180.0, 180.0, 120.0], [1.0, 1.0, 0.0], UP, [45.000, 82.044, 93.684, 90.000, 61.316, 0.000]),
];

/// T1 to T6, wrist, tip, edge of the disc.
const FRAMES: [([f64; 6], Triple, Triple, Triple); 11] = [
    (
        [90.0, 115.0, 65.0, 90.0, 90.0, 90.0],
        [0.00, 177.14, 208.26],
        [0.00, 199.60, 208.26],
        [-20.00, 199.60, 208.26],
    ),
    (
        [50.0, 80.0, 50.0, 50.0, 50.0, 50.0],
        [151.35, 180.37, 268.20],
        [167.30, 184.94, 283.34],
        [155.13, 178.85, 298.00],
    ),
    (
        [45.0, 90.0, 90.0, 90.0, 90.0, 90.0],
        [155.43, 155.43, 133.27],
        [169.83, 169.83, 123.78],
        [155.69, 183.97, 123.78],
    ),
    (
        [180.0, 90.0, 65.0, 90.0, 90.0, 90.0],
        [-227.85, 0.00, 219.50],
        [-250.31, 0.00, 219.50],
        [-250.31, -20.00, 219.50],
    ),
    (
        [90.0, 90.0, 65.0, 90.0, 0.0, 90.0],
        [0.00, 227.85, 219.50],
        [0.00, 227.85, 241.96],
        [-20.00, 227.85, 241.96],
    ),
    (
        [90.0, 90.0, 65.0, 90.0, 90.0, 0.0],
        [0.00, 227.85, 219.50],
        [0.00, 250.31, 219.50],
        [0.00, 250.31, 239.50],
    ),
    (
        [90.0, 90.0, 65.0, 45.0, 45.0, 90.0],
        [0.00, 227.85, 219.50],
        [11.23, 243.73, 230.73],
        [-2.91, 243.73, 244.87],
    ),
    (
        [90.0, 50.0, 100.0, 90.0, 90.0, 90.0],
        [0.00, 283.43, 73.05],
        [0.00, 301.82, 60.17],
        [-20.00, 301.82, 60.17],
    ),
    (
        [120.0, 70.0, 95.0, 60.0, 120.0, 30.0],
        [-127.40, 220.66, 109.66],
        [-138.25, 228.23, 91.52],
        [-147.51, 241.94, 102.77],
    ),
    (
        [75.0, 88.0, 110.0, 90.0, 135.0, 90.0],
        [49.58, 185.05, 71.74],
        [49.58, 185.05, 49.28],
        [30.27, 190.22, 49.28],
    ),
    (
        [74.0, 88.0, 109.0, 90.0, 135.0, 90.0],
        [53.39, 186.19, 74.52],
        [53.50, 186.57, 52.06],
        [34.27, 192.08, 52.06],
    ),
];

fn all<F: Float + Into<f64>>() {
    for (tip, tool, angles) in IK6 {
        let found = ik6::<F>(vector(tip), vector(tool)).expect("the maker's solver reaches it");
        assert_near(found, angles, 0.001, &format!("IK6 {tip:?} {tool:?}"));
    }
    for (wrist, angles) in IK5 {
        let found = ik5::<F>(vector(wrist)).expect("the maker's solver reaches it");
        assert_near(found, angles, 0.001, &format!("IK5 {wrist:?}"));
    }
    for (tip, tool, disc, angles) in IK7 {
        let found = ik7::<F>(vector(tip), vector(tool), vector(disc)).expect("the maker's solver reaches it");
        assert_near(found, angles, 0.001, &format!("IK7 {tip:?} {tool:?} {disc:?}"));
    }
    for (angles, wrist, tip, edge) in FRAMES {
        let frames = forward(angles.map(F::of));
        for (found, wanted) in
            [(frames.arm.wrist, wrist), (frames.hand.tip, tip), (frames.hand.disc_edge, edge)]
        {
            assert_near([found.x, found.y, found.z], wanted, 0.005_1, &format!("{angles:?}"));
        }
    }
}

#[test]
fn the_makers_kinematics_say_the_same_in_f64() {
    all::<f64>();
}

#[test]
fn the_makers_kinematics_say_the_same_in_f32() {
    all::<f32>();
}

#[test]
fn what_the_maker_refuses_is_refused_for_a_reason() {
    use NoSolution::{Joint, NoHeading, NoToolDirection, TooFar, TooNear, ToolDirection};
    let refused = [
        ([500.0, 185.0, 50.0], DOWN, TooFar),
        ([0.0, 200.0, 400.0], UP, TooFar),
        ([0.0, 365.0, 140.0], FORWARD, TooFar),
        ([0.0, 0.0, 200.0], DOWN, NoHeading),
        ([100.0, 200.0, 150.0], [0.0; 3], NoToolDirection),
        ([100.0, 200.0, 150.0], UP, ToolDirection),
        ([0.0, 200.0, 100.0], [1.0, 0.0, 0.0], ToolDirection),
        ([0.0, -200.0, 100.0], DOWN, Joint(1)),
    ];
    for (tip, tool, why) in refused {
        assert_eq!(ik6::<f64>(vector(tip), vector(tool)), Err(why), "{tip:?} {tool:?}");
        assert_eq!(ik6::<f32>(vector(tip), vector(tool)), Err(why), "{tip:?} {tool:?}");
    }
    for (wrist, why) in
        [([400.0, 0.0, 100.0], TooFar), ([0.0, 60.0, 60.0], TooNear), ([0.0, 0.0, 200.0], NoHeading)]
    {
        assert_eq!(ik5::<f64>(vector(wrist)), Err(why), "{wrist:?}");
        assert_eq!(ik5::<f32>(vector(wrist)), Err(why), "{wrist:?}");
    }
}

#[test]
fn joint_6_turns_to_the_side_that_the_maker_confuses() {
    // The maker's solver answers 106.70 degrees.
    let [.., t6] =
        ik7::<f64>(vector([200.0, 60.0, 100.0]), vector(DOWN), vector(FORWARD)).expect("within reach");
    assert!((t6 - 73.301).abs() < 0.001, "{t6}");
}
