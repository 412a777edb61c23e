//! The room of the arm: a table, walls, and objects that can be gripped, sucked, pushed, stacked and dropped.
//!
//! ```text
//!   angles, claws, pump ──▶ Hand ──▶ balls ──▶ touch table, walls and objects ──▶ torques on joints 1 to 6
//!                             │                          └──▶ objects that stand free are pushed
//!                             └──▶ an object between the claws or at the cup is carried, and dropped
//! ```
//!
//! This is not a simulation of rigid bodies. It simulates only contacts that matter for sorting and stacking, in steps of a
//! millisecond:
//! - Where a part of the arm or a carried object touches something, it is pushed back at right angles to the surface, by 8 N for
//!   each mm of depth. The table is an obstacle like any other. There is no friction and no bounce.
//! - An object that is pushed from the side moves out of the way, with the objects that stand on it, unless a wall or a row of
//!   objects stops it. It never tips over, and does not turn.
//! - An object falls to the highest surface below its middle, and stands there upright. An object that is let go turns upright.
//! - The claws carry an object once they touch it on both sides, however hard they press, until they open. The cup carries
//!   an object that it touches with the pump on.
//!
//! All numbers are `f64`, computed with the operations of [`kinematics`]: all machines get the same bits.

mod frame;
mod hand;
mod moving;
mod solid;

use alloc::vec::Vec;

use kinematics::Vector;
use protocol_core::registers::JOINTS;

use crate::scene::{Block, Item, Scene, Tool};
pub use frame::SolidFrame;
use frame::{Point, UP};
use hand::{Ball, Grip, Hand, angle_for};
use solid::Solid;

/// The contact force in N for each mm of depth: low enough to be stable with the lightest part of the arm.
const STIFFNESS: f64 = 8.0;
/// Claws that are narrower than an object by more than this do not hold it, in mm.
const PLAY: f64 = 4.0;
/// The cup takes an object at this distance or nearer, in mm.
const SUCTION: f64 = 3.0;

/// A cube or cylinder of the scene, where it is now.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Object {
    /// Its name, form and weight, and its initial position.
    pub item: Item,
    /// Its present position: the origin is its middle.
    pub frame: SolidFrame,
    /// Do the claws or the cup hold it? Then it moves with the tip, and does not fall.
    pub is_carried: bool,
    solid: Solid,
    /// Downward, in mm per second.
    speed: f64,
}

impl Object {
    fn bottom(&self) -> f64 {
        self.frame.origin.z - self.solid.half_height()
    }

    fn top(&self) -> f64 {
        self.frame.origin.z + self.solid.half_height()
    }

    /// Does the vertical line through this point meet the object?
    fn covers(&self, point: Point) -> bool {
        let at = Vector::new(point.x, point.y, self.frame.origin.z);
        self.solid.touch(&self.frame, at, 0.0).is_some()
    }
}

/// The state of the arm in a step of the room.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ArmInWorld {
    /// The true angles of joints 1 to 7, in degrees.
    pub(crate) angles: [f64; JOINTS],
    /// The claws have touched the object between them, and have not opened since.
    pub(crate) is_gripping: bool,
    /// The pump sucks.
    pub(crate) is_sucking: bool,
}

/// The effect of the room on the arm.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Effect {
    /// The torques on joints 1 to 6 in mN m, towards greater angles.
    pub(crate) torques: [f64; 6],
    /// The angle of joint 7 in degrees at which the claws touch the object between them. `None` without an object, or if the claws
    /// cannot have its width.
    pub(crate) claw_stop: Option<f64>,
    /// The weight of the carried object, in grams.
    pub(crate) load_g: u16,
}

/// The table, with everything on it.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct World {
    scene: Scene,
    walls: Vec<(SolidFrame, Solid)>,
    objects: Vec<Object>,
    /// The object between the claws, carried or not.
    between: Option<usize>,
    /// The carried object, and its frame relative to the tip.
    carried: Option<(usize, SolidFrame)>,
    /// An object was torn off the cup. The cup takes no object until the pump was switched off.
    is_torn_off: bool,
    is_moving: bool,
}

impl World {
    /// The room in its initial state.
    #[must_use]
    pub fn new(scene: Scene) -> Self {
        let table = scene.table;
        let wall = |Block { at: [x, y], size, .. }: &Block| {
            let [_, _, height] = *size;
            let frame = SolidFrame::upright(Vector::new(*x, *y, table + height / 2.0), 0.0);
            (frame, Solid::Box(size.map(|edge| edge / 2.0)))
        };
        let walls = scene.walls.iter().map(wall).collect();
        let items = scene.items.clone();
        let mut world = Self {
            scene,
            walls,
            objects: Vec::new(),
            between: None,
            carried: None,
            is_torn_off: false,
            is_moving: true,
        };
        items.into_iter().for_each(|item| world.place(item));
        world
    }

    /// Puts an object on the highest surface at its place: the table, a wall or an earlier object.
    fn place(&mut self, item: Item) {
        let solid = Solid::from(item.form);
        let [x, y] = item.at;
        let top = self.support(None, Vector::new(x, y, f64::MAX));
        let frame = SolidFrame::upright(Vector::new(x, y, top + solid.half_height()), item.turn);
        self.objects.push(Object { item, frame, is_carried: false, solid, speed: 0.0 });
    }

    /// The scene with which the room began.
    #[must_use]
    pub const fn scene(&self) -> &Scene {
        &self.scene
    }

    /// The objects, in the order of the scene.
    #[must_use]
    pub fn objects(&self) -> &[Object] {
        &self.objects
    }

    /// Did an object fall, or was one pushed or dropped, in the last step?
    pub(crate) const fn is_moving(&self) -> bool {
        self.is_moving
    }

    /// Simulates a millisecond. `arm` is the state of the arm at its end.
    pub(crate) fn step(&mut self, arm: ArmInWorld) -> Effect {
        self.is_moving = false;
        let hand = Hand::new(arm.angles);
        self.carry(&hand, arm);
        self.fall();
        let balls = self.balls(&hand);
        balls.iter().for_each(|ball| self.push_objects(ball));
        let claw_stop = self.claw_stop(&hand);
        let carried = self.carried.and_then(|(index, _)| self.objects.get(index));
        Effect {
            torques: self.torques(&hand, &balls),
            claw_stop,
            load_g: carried.map_or(0, |object| object.item.grams),
        }
    }

    /// Takes, moves or drops the object that the arm carries.
    fn carry(&mut self, hand: &Hand, arm: ArmInWorld) {
        let tip = hand.tip();
        self.is_torn_off &= arm.is_sucking;
        let is_holding = match self.scene.tool {
            Tool::Claws => arm.is_gripping,
            Tool::Cup => arm.is_sucking && !self.is_torn_off,
        };
        if !is_holding {
            self.drop_carried();
            return;
        }
        if self.carried.is_none() {
            let found = match self.scene.tool {
                Tool::Claws => self.between,
                Tool::Cup => self.at_cup(&tip),
            };
            let found = found.and_then(|index| Some((index, self.objects.get(index)?.frame.seen_from(&tip))));
            self.carried = found;
        }
        let Some((index, frame)) = self.carried else { return };
        if let Some(object) = self.objects.get_mut(index) {
            (object.is_carried, object.speed) = (true, 0.0);
            object.frame = frame.carried_by(&tip);
        }
    }

    /// Drops the object that the arm carries. The cup takes no object until the pump was switched off.
    pub(crate) fn tear_off(&mut self) {
        self.is_torn_off = self.carried.is_some();
        self.drop_carried();
    }

    fn drop_carried(&mut self) {
        let Some((index, _)) = self.carried.take() else { return };
        self.between = None;
        if let Some(object) = self.objects.get_mut(index) {
            object.is_carried = false;
            object.frame = SolidFrame::upright(object.frame.origin, object.frame.turn());
            self.is_moving = true;
        }
    }

    /// The object at the end of the cup.
    fn at_cup(&self, tip: &SolidFrame) -> Option<usize> {
        let end = tip.point(Vector::new(hand::CUP, 0.0, 0.0));
        self.objects.iter().position(|object| {
            let touch = object.solid.touch(&object.frame, end, SUCTION);
            // The cup seals only on a face that is roughly at a right angle to it.
            touch.is_some_and(|touch| touch.normal.dot(tip.x) < -0.9)
        })
    }

    /// Finds the object between the claws, and moves it to their middle as they close. Returns the angle of joint 7 at which they
    /// touch it.
    fn claw_stop(&mut self, hand: &Hand) -> Option<f64> {
        if self.scene.tool == Tool::Cup {
            return None;
        }
        let grip = hand.grip();
        self.between = match self.carried {
            Some((index, _)) => Some(index),
            None => self.find_between(&grip),
        };
        let index = self.between?;
        let object = self.objects.get(index)?;
        let reach = object.solid.reach(&object.frame, grip.frame.y);
        let aside = grip.frame.local(object.frame.origin).y;
        let excess = aside.abs() + reach - grip.gap / 2.0;
        if self.carried.is_none() && excess > 0.0 && aside != 0.0 {
            self.shove(index, grip.frame.y * (excess.min(aside.abs()) * -aside.signum()), 0);
        }
        angle_for(2.0 * reach)
    }

    fn find_between(&self, grip: &Grip) -> Option<usize> {
        self.objects.iter().position(|object| {
            let Vector { x, y, z } = grip.frame.local(object.frame.origin);
            let reach = |axis| object.solid.reach(&object.frame, axis);
            let [ahead, aside, above] = [grip.frame.x, grip.frame.y, grip.frame.z].map(reach);
            // The middle of each pad has to meet the object.
            let is_at_pads = x.abs() < ahead && z.abs() < above;
            is_at_pads && y.abs() < grip.gap / 2.0 && 2.0 * aside < grip.gap + PLAY
        })
    }

    /// The balls of the arm, and the corners of the carried object.
    fn balls(&self, hand: &Hand) -> Vec<Ball> {
        let carried = self.carried.and_then(|(index, _)| self.objects.get(index));
        let corners = carried
            .into_iter()
            .flat_map(|object| object.solid.corners(&object.frame).map(|point| Ball::new(point, 0.0, 6)));
        hand.balls(self.scene.tool).chain(corners).collect()
    }

    /// Is this ball the end of a finger, and the object between the claws? Then the pads touch the object, and the ball does not.
    fn is_left_to_pads(&self, index: usize, ball: &Ball) -> bool {
        ball.is_finger_end && self.between == Some(index)
    }

    /// The torques of all contacts, in mN m.
    fn torques(&self, hand: &Hand, balls: &[Ball]) -> [f64; 6] {
        let mut sum = [0.0; 6];
        for ball in balls {
            let force = self.force(ball);
            if force != Vector::new(0.0, 0.0, 0.0) {
                let torques = hand.torques(ball.point, ball.joints, force);
                sum.iter_mut().zip(torques).for_each(|(sum, torque)| *sum += torque);
            }
        }
        sum
    }

    /// The force on a ball, in N.
    fn force(&self, ball: &Ball) -> Point {
        let under = self.scene.table - ball.point.z + ball.radius;
        let table = UP * (STIFFNESS * under.max(0.0));
        let free = self
            .objects
            .iter()
            .enumerate()
            .filter(|(index, object)| !object.is_carried && !self.is_left_to_pads(*index, ball));
        let solids = self.walls.iter().map(|(frame, solid)| (frame, *solid));
        let solids = solids.chain(free.map(|(_, object)| (&object.frame, object.solid)));
        let touches = solids.filter_map(|(frame, solid)| solid.touch(frame, ball.point, ball.radius));
        touches.fold(table, |sum, touch| sum + touch.normal * (STIFFNESS * touch.depth))
    }
}
