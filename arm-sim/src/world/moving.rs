//! Objects that fall, and objects that are pushed along the surface on which they stand.

use alloc::vec::Vec;

use kinematics::Vector;

use super::frame::Point;
use super::hand::Ball;
use super::{Object, World};

const STEP_S: f64 = 0.001;
/// In mm per second squared.
const GRAVITY: f64 = 9_807.0;
/// The tolerance for rounding errors in heights, in mm.
const ROUNDING: f64 = 1e-6;
/// Two surfaces this near to each other touch, in mm.
const NEAR: f64 = 0.5;
/// A pushed object moves at most this many other objects in a row. A longer row does not move.
const LONGEST_ROW: u32 = 4;

impl World {
    pub(super) fn fall(&mut self) {
        for index in 0..self.objects.len() {
            let Some(object) = self.objects.get(index).filter(|object| !object.is_carried) else { continue };
            let (bottom, middle) = (object.bottom(), object.frame.origin);
            let support = self.support(Some(index), middle);
            let Some(object) = self.objects.get_mut(index) else { continue };
            let is_falling = bottom > support + ROUNDING;
            object.speed = if is_falling { object.speed + GRAVITY * STEP_S } else { 0.0 };
            // An object that was pressed into its support when it was let go comes up again.
            let next = (bottom - object.speed * STEP_S).max(support);
            object.frame.origin.z = next + object.solid.half_height();
            self.is_moving |= is_falling;
        }
    }

    /// The height of the highest surface below `middle`: the table, or the top of a wall or of an object other than `index`.
    pub(super) fn support(&self, index: Option<usize>, middle: Point) -> f64 {
        let walls = self.walls.iter().filter_map(|(frame, solid)| {
            let at = Vector::new(middle.x, middle.y, frame.origin.z);
            solid.touch(frame, at, 0.0).map(|_| frame.origin.z + solid.half_height())
        });
        let others =
            self.objects.iter().enumerate().filter(|(other, object)| {
                Some(*other) != index && !object.is_carried && object.covers(middle)
            });
        let tops = walls.chain(others.map(|(_, object)| object.top()));
        tops.filter(|top| *top <= middle.z).fold(self.scene.table, f64::max)
    }

    /// Moves objects out of the way of a ball that touches their side.
    pub(super) fn push_objects(&mut self, ball: &Ball) {
        for index in 0..self.objects.len() {
            let Some(object) = self.objects.get(index) else { continue };
            if object.is_carried || self.is_left_to_pads(index, ball) {
                continue;
            }
            let Some(touch) = object.solid.touch(&object.frame, ball.point, ball.radius) else { continue };
            if touch.normal.z.abs() < 0.5 {
                self.shove(index, touch.normal * -touch.depth, 0);
            }
        }
    }

    /// Moves an object, and the objects in its way, horizontally. `row` is the number of pushed objects before it. Returns
    /// `false` if a wall or a row of more than [`LONGEST_ROW`] objects stops it.
    pub(super) fn shove(&mut self, index: usize, by: Point, row: u32) -> bool {
        let Some(object) = self.objects.get(index) else { return false };
        let (radius, bottom, top) = (object.solid.inner_radius(), object.bottom(), object.top());
        let from = object.frame.origin;
        let to = from + by;
        let is_stopped = self.walls.iter().any(|(frame, solid)| {
            let wall = frame.origin.z + solid.half_height();
            let at = |point: Point| Vector::new(point.x, point.y, frame.origin.z);
            let depth = |point| solid.touch(frame, at(point), radius).map_or(0.0, |touch| touch.depth);
            bottom < wall - NEAR && depth(to) > depth(from)
        });
        if is_stopped || row > LONGEST_ROW {
            return false;
        }
        for other in 0..self.objects.len() {
            let Some(next) = self.objects.get(other).filter(|next| other != index && !next.is_carried) else {
                continue;
            };
            let apart = Vector::new(next.frame.origin.x - to.x, next.frame.origin.y - to.y, 0.0);
            let overlap = radius + next.solid.inner_radius() - apart.length();
            let is_beside = bottom < next.top() - NEAR && next.bottom() < top - NEAR;
            if is_beside && overlap > 0.0 && apart.dot(by) > 0.0 {
                let Some(direction) = apart.unit() else { return false };
                if !self.shove(other, direction * overlap, row + 1) {
                    return false;
                }
            }
        }
        self.slide(index, by);
        true
    }

    /// Moves an object, and the objects that stand on it.
    fn slide(&mut self, index: usize, by: Point) {
        for rider in self.riders(index) {
            self.slide(rider, by);
        }
        if let Some(object) = self.objects.get_mut(index) {
            object.frame.origin = object.frame.origin + Vector::new(by.x, by.y, 0.0);
            self.is_moving = true;
        }
    }

    /// The objects that stand on an object.
    fn riders(&self, index: usize) -> Vec<usize> {
        let Some(below) = self.objects.get(index) else { return Vec::new() };
        let stands_on_it = |rider: &Object| {
            let is_at_top = (rider.bottom() - below.top()).abs() < NEAR;
            is_at_top && !rider.is_carried && below.covers(rider.frame.origin)
        };
        let all = self.objects.iter().enumerate();
        all.filter(|(_, rider)| stands_on_it(rider)).map(|(rider, _)| rider).collect()
    }
}
