//! An array with one value per joint.

use std::ops::{Index, IndexMut};

use protocol_core::registers::{JOINTS, Joint};

/// One value per joint, indexed by [`Joint`]. Joint 1 comes first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PerJoint<T>(pub [T; JOINTS]);

impl<T: Copy> PerJoint<T> {
    /// The same value for all joints.
    pub const fn all(value: T) -> Self {
        Self([value; JOINTS])
    }
}

#[allow(clippy::indexing_slicing)] // A joint's index is below the number of joints.
impl<T> Index<Joint> for PerJoint<T> {
    type Output = T;

    fn index(&self, joint: Joint) -> &T {
        &self.0[usize::from(joint.index())]
    }
}

#[allow(clippy::indexing_slicing)] // A joint's index is below the number of joints.
impl<T> IndexMut<Joint> for PerJoint<T> {
    fn index_mut(&mut self, joint: Joint) -> &mut T {
        &mut self.0[usize::from(joint.index())]
    }
}
