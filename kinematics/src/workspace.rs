//! The space that the arm must not enter: below the table, and its own base.
//!
//! ```text
//!                │ base axis
//!   ┌────────────┼────────────┐ z = 10: the top plate and the margin
//!   │ margin ┌───┴───┐        │
//!   │        │ base  │        │ radius 88: the foot and the margin
//!   ┴────────┴───────┴────────┴──── table, z = -60 at the foot
//! ```
//!
//! The cylinder of the base has no lower end: below the foot is the support of the base. The turret above the base
//! needs no check: the linkage keeps the wrist 106 mm from the shoulder, and the elbow is never below the shoulder.
//!
//! This file knows neither paths nor joint limits. [`crate::limits`] checks the limits.

use crate::float::Float;
use crate::forward::{ArmFrames, Frames, HandFrames};
use crate::geometry::{BASE_HEIGHT, BASE_RADIUS, DISC_RADIUS};
use crate::vector::Vector;

/// The distance that the arm keeps from its base, in mm. The hand is checked as a line, and half of its width is 13.5 mm. A
/// smaller margin is enough, because the parts of the hand are round.
pub const BASE_MARGIN: f64 = 10.0;
/// The radius of the cylinder that is kept free, in mm.
pub const KEEP_OUT_RADIUS: f64 = BASE_RADIUS + BASE_MARGIN;
/// The upper end of the cylinder that is kept free: z in mm.
pub const KEEP_OUT_TOP: f64 = BASE_MARGIN;
/// Steps of the search for the deepest point of a segment. Each step keeps two thirds of the range: 200 mm / 1.5^30 is 1 um.
const SEARCH_STEPS: u32 = 30;
/// Sine and cosine of an eighth of a turn.
const EIGHTH: f64 = core::f64::consts::FRAC_1_SQRT_2;
/// Directions from the tip to the checked points of the disc's edge, an eighth of a turn apart. Between two of these
/// points the edge is up to 1.5 mm further out.
const EDGE: [[f64; 2]; 8] = [
    [1.0, 0.0],
    [EIGHTH, EIGHTH],
    [0.0, 1.0],
    [-EIGHTH, EIGHTH],
    [-1.0, 0.0],
    [-EIGHTH, -EIGHTH],
    [0.0, -1.0],
    [EIGHTH, -EIGHTH],
];

/// A part of the arm that is checked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// The axis between rear arm and forearm.
    Elbow,
    /// The axis of the forearm, from its start above the elbow to the wrist.
    Forearm,
    /// The point where the axes of joints 4, 5 and 6 meet.
    Wrist,
    /// The line from the wrist to the tip.
    Hand,
    /// The middle of the disc.
    Tip,
    /// The edge of the disc, all round.
    DiscEdge,
}

/// What the arm must not enter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FixedObstacle {
    /// The half space below the table.
    Table,
    /// The cylinder round the base.
    Base,
}

/// The part of the arm that is nearest to an obstacle, or deepest in it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clearance {
    /// The part of which `mm` is the distance.
    pub part: Part,
    /// The obstacle from which `mm` is measured.
    pub obstacle: FixedObstacle,
    /// The distance between part and obstacle in mm; negative inside the obstacle. The distance from the base is the larger
    /// one of the distances from its side and from its top.
    pub mm: f64,
}

/// The space that the arm must not enter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Workspace {
    /// The height of the table: its z coordinate in mm.
    pub table: f64,
}

impl Default for Workspace {
    /// The table at the foot of the base.
    fn default() -> Self {
        Self { table: -BASE_HEIGHT }
    }
}

impl Workspace {
    /// The smallest clearance of all parts. The angles of joints 1 to 5 are in degrees. Joint 6 only turns the disc about its own
    /// axis, and joint 7 is not in the geometry.
    #[must_use]
    pub fn clearance(&self, [t1, t2, t3, t4, t5]: [f64; 5]) -> Clearance {
        let arm = ArmFrames::of([t1, t2, t3]);
        let hand = HandFrames::of(&arm, [t4, t5, 0.0]);
        let frames = Frames { arm, hand };
        let (above_table, from_base) = (self.above_table(&frames), from_base(&frames));
        if above_table.mm < from_base.mm { above_table } else { from_base }
    }

    fn above_table(&self, Frames { arm, hand }: &Frames<f64>) -> Clearance {
        // The edge of the disc reaches below the tip: by the radius if the disc is upright, and by nothing if it is level.
        let level = (1.0 - hand.tool.z * hand.tool.z).max(0.0);
        let edge = hand.tip.z - DISC_RADIUS * Float::sqrt(level);
        let parts = [
            (Part::Tip, hand.tip.z),
            (Part::DiscEdge, edge),
            (Part::Wrist, arm.wrist.z),
            (Part::Elbow, arm.elbow.z),
        ];
        smallest(FixedObstacle::Table, parts.map(|(part, z)| (part, z - self.table)))
    }
}

fn from_base(Frames { arm, hand }: &Frames<f64>) -> Clearance {
    let edge = EDGE.map(|[ahead, aside]| {
        let direction = hand.disc_zero * ahead + hand.disc_right * aside;
        distance_from_base(hand.tip + direction * DISC_RADIUS)
    });
    let parts = [
        (Part::Tip, distance_from_base(hand.tip)),
        (Part::DiscEdge, edge.into_iter().fold(f64::INFINITY, f64::min)),
        (Part::Wrist, distance_from_base(arm.wrist)),
        (Part::Elbow, distance_from_base(arm.elbow)),
        (Part::Hand, segment_from_base(arm.wrist, hand.tip)),
        (Part::Forearm, segment_from_base(arm.forearm, arm.wrist)),
    ];
    smallest(FixedObstacle::Base, parts)
}

/// The first of the parts with the smallest distance. `parts` is not empty.
fn smallest<const N: usize>(obstacle: FixedObstacle, parts: [(Part, f64); N]) -> Clearance {
    let none = (Part::Tip, f64::INFINITY);
    let (part, mm) = parts.into_iter().fold(none, |least, next| if next.1 < least.1 { next } else { least });
    Clearance { part, obstacle, mm }
}

/// The distance of a point from the cylinder of the base; negative inside.
fn distance_from_base(point: Vector<f64>) -> f64 {
    let from_axis = Float::sqrt(point.x * point.x + point.y * point.y);
    (from_axis - KEEP_OUT_RADIUS).max(point.z - KEEP_OUT_TOP)
}

/// The smallest distance of the points of a line from the cylinder of the base. The distance is convex along the line, so a
/// search by thirds finds the smallest one.
fn segment_from_base(from: Vector<f64>, to: Vector<f64>) -> f64 {
    let at = |share: f64| distance_from_base(from + (to - from) * share);
    let ends = at(0.0).min(at(1.0));
    if from.z.min(to.z) > KEEP_OUT_TOP {
        // No point of the line is lower than its ends, so all are above the cylinder. A point between the ends may be nearer
        // than both ends, but its distance is positive.
        return ends;
    }
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..SEARCH_STEPS {
        let third = (high - low) / 3.0;
        if at(low + third) < at(high - third) { high -= third } else { low += third }
    }
    ends.min(at((low + high) / 2.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{forward, ik6};

    const ON_FOOT: Workspace = Workspace { table: -60.0 };

    /// The clearance with the tip at a point and the tool straight down.
    fn tool_down(x: f64, y: f64, z: f64) -> Clearance {
        let angles = ik6(Vector::new(x, y, z), Vector::new(0.0, 0.0, -1.0)).expect("within reach");
        ON_FOOT.clearance(angles)
    }

    #[test]
    fn the_standard_pose_is_far_from_everything() {
        let clearance = ON_FOOT.clearance([90.0, 90.0, 65.0, 90.0, 90.0]);
        assert_eq!((clearance.obstacle, clearance.part), (FixedObstacle::Base, Part::Elbow));
        assert_eq!(clearance.mm, 74.5 + 120.0 - 10.0);
    }

    #[test]
    fn a_tip_below_the_table_is_told_with_its_depth() {
        let clearance = tool_down(0.0, 185.0, -100.0);
        assert_eq!((clearance.obstacle, clearance.part), (FixedObstacle::Table, Part::Tip));
        assert!((clearance.mm + 40.0).abs() < 1e-9, "{clearance:?}");
        let on_a_block = Workspace { table: -101.5 };
        let angles = ik6(Vector::new(0.0, 185.0, -100.0), Vector::new(0.0, 0.0, -1.0)).expect("within reach");
        assert!((on_a_block.clearance(angles).mm - 1.5).abs() < 1e-9);
    }

    #[test]
    fn an_upright_disc_touches_the_table_by_its_edge() {
        let angles = ik6(Vector::new(0.0, 250.0, -45.0), Vector::new(0.0, 1.0, 0.0)).expect("within reach");
        let clearance = ON_FOOT.clearance(angles);
        assert_eq!((clearance.obstacle, clearance.part), (FixedObstacle::Table, Part::DiscEdge));
        assert!((clearance.mm + 5.0).abs() < 1e-9, "{clearance:?}");
    }

    #[test]
    fn a_hand_beside_the_base_is_inside_its_margin() {
        let clearance = tool_down(0.0, 100.0, -40.0);
        assert_eq!((clearance.obstacle, clearance.part), (FixedObstacle::Base, Part::DiscEdge));
        assert!((clearance.mm - (100.0 - 20.0 - 88.0)).abs() < 1e-9, "{clearance:?}");
    }

    #[test]
    fn the_line_of_the_forearm_is_checked_between_its_ends() {
        let (from, to) = (Vector::new(0.0, 60.0, 150.0), Vector::new(0.0, 100.0, -50.0));
        assert!(distance_from_base(from) > 0.0 && distance_from_base(to) > 0.0);
        // At z = 10 the line is 85 mm from the axis, inside the radius of 88 mm. It is deepest at z = 7.6: by 2.4 mm.
        let crossing = segment_from_base(Vector::new(0.0, 50.0, 150.0), to);
        let dense = (0..=100_000).map(|step| {
            let share = f64::from(step) / 1e5;
            distance_from_base(Vector::new(0.0, 50.0 + 50.0 * share, 150.0 - 200.0 * share))
        });
        let dense = dense.fold(f64::INFINITY, f64::min);
        assert!(crossing < 0.0 && (crossing - dense).abs() < 0.002, "{crossing} {dense}");
    }

    #[test]
    fn no_legal_pose_brings_the_elbow_below_the_shoulder() {
        for t2 in 0..=180 {
            let elbow = forward([90.0, f64::from(t2), 65.0, 90.0, 90.0, 90.0]).arm.elbow;
            assert!(elbow.z >= crate::geometry::SHOULDER_HEIGHT - 1e-9);
        }
    }
}
