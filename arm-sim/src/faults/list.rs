//! The faults that an arm has, and when they end.

use alloc::collections::VecDeque;
use alloc::vec::Vec;

use protocol_core::time::Instant;

use super::{ArmFault, FaultLocation, FaultReport, Obstacle};

/// The most reports of ended faults that are kept.
const REPORTS: usize = 16;

/// A fault, and when its duration is over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct ListedFault {
    pub(crate) fault: ArmFault,
    pub(crate) until: Option<Instant>,
}

/// The faults, in the order in which they began. None of them replaces another (see [`ArmFault::replaces`]).
#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct FaultList(Vec<ListedFault>);

impl FaultList {
    /// Adds a fault. Call [`FaultList::take_replaced`] before.
    pub(crate) fn add(&mut self, fault: ArmFault, until: Option<Instant>) {
        self.0.push(ListedFault { fault, until });
    }

    /// Takes the fault that a new one replaces.
    pub(crate) fn take_replaced(&mut self, new: ArmFault) -> Option<ListedFault> {
        self.take(|listed| new.replaces(listed.fault)).pop()
    }

    /// Takes the faults at a location, or all faults.
    pub(crate) fn take_at(&mut self, location: Option<FaultLocation>) -> Vec<ListedFault> {
        self.take(|listed| location.is_none_or(|location| listed.fault.location() == location))
    }

    /// Is something between the claws?
    pub(crate) fn has_thing(&self) -> bool {
        self.0.iter().any(|listed| matches!(listed.fault, ArmFault::Obstacle(_, Obstacle::Thing(_))))
    }

    /// Takes the things between the claws.
    pub(crate) fn take_things(&mut self) -> Vec<ListedFault> {
        self.take(|listed| matches!(listed.fault, ArmFault::Obstacle(_, Obstacle::Thing(_))))
    }

    /// Takes the faults that end by `now`.
    pub(crate) fn take_due(&mut self, now: Instant) -> Vec<ListedFault> {
        self.take(|listed| listed.until.is_some_and(|until| until <= now))
    }

    fn take(&mut self, is_taken: impl Fn(&ListedFault) -> bool) -> Vec<ListedFault> {
        let (taken, left) = self.0.iter().partition(|listed| is_taken(listed));
        self.0 = left;
        taken
    }

    /// When the next duration is over. `None`: no fault has one.
    pub(crate) fn deadline(&self) -> Option<Instant> {
        self.0.iter().filter_map(|listed| listed.until).min()
    }

    /// Does the arm have this fault?
    pub(crate) fn contains(&self, fault: ArmFault) -> bool {
        self.0.iter().any(|listed| listed.fault == fault)
    }

    pub(crate) fn iter(&self) -> impl Iterator<Item = ListedFault> {
        self.0.iter().copied()
    }
}

/// The reports of the faults that ended by themselves.
#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct EndedFaults(VecDeque<FaultReport>);

impl EndedFaults {
    pub(crate) fn push(&mut self, report: FaultReport) {
        if self.0.len() >= REPORTS {
            self.0.pop_front();
        }
        self.0.push_back(report);
    }

    pub(crate) fn take(&mut self) -> Vec<FaultReport> {
        core::mem::take(&mut self.0).into()
    }
}
