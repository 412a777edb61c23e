//! A page and its simulated arm, for tests: a picture each 1/60 s of virtual time.

use block_programs::Program;
use exercises::Observation;
use protocol_core::time::Instant;
use sevenbot::Joint;
use sevenbot::map::{SPEED, TIME};

use crate::client::Client;
use crate::exercise::observation;
use crate::preview::exchange;
use crate::program::{Pace, ProgramProgress, ProgramRun};
use crate::source::simulator::SimulatedSource;

/// A picture of the page is shown each 1/60 s.
const PICTURE_MICROS: f64 = 16_667.0;

/// A page and its simulated arm.
pub(crate) struct Tab {
    pub(crate) client: Client,
    pub(crate) arm: SimulatedSource,
}

impl Tab {
    /// An arm that was switched on a second ago.
    pub(crate) fn new() -> Self {
        let mut tab = Self { client: Client::default(), arm: SimulatedSource::default() };
        tab.pass(100);
        assert!(tab.client.is_connected());
        tab
    }

    /// As the page does for each picture.
    pub(crate) fn pass(&mut self, pictures: u32) {
        (0..pictures).for_each(|_| exchange(&mut self.client, &mut self.arm, PICTURE_MICROS));
    }

    pub(crate) fn now(&self) -> Instant {
        self.arm.now()
    }

    /// What an exercise sees.
    pub(crate) fn observation(&self) -> Observation {
        observation(self.now(), self.client.registers(), self.arm.simulation().plant().world())
    }

    pub(crate) fn act(&mut self, action: &str) {
        self.arm.act(action.parse().expect("an action"));
    }

    pub(crate) fn begin(&self, workspace: &str, pace: Pace) -> ProgramRun {
        let program = Program::parse(workspace).unwrap_or_else(|error| panic!("{error:?}"));
        ProgramRun::new(&program, pace, self.client.registers(), self.now())
    }

    /// Runs a program to its end. `during` gets the number of each picture, and may break something.
    pub(crate) fn run(
        &mut self,
        workspace: &str,
        mut during: impl FnMut(u32, &mut Self),
    ) -> (ProgramProgress, ProgramRun) {
        let mut run = self.begin(workspace, Pace::Running);
        for picture in 0..20_000 {
            during(picture, self);
            match run.poll(self.now(), &mut self.client) {
                ProgramProgress::Running => self.pass(1),
                end => return (end, run),
            }
        }
        panic!("it does not end, at {:?}: {:?}", run.block(), run);
    }

    /// The true angles of all joints, in degrees.
    pub(crate) fn angles(&self) -> [f64; 7] {
        Joint::ALL.map(|joint| f64::from(self.arm.simulation().plant().angle(joint)) / 1e3)
    }

    pub(crate) fn registers(&self) -> Vec<u8> {
        [SPEED, TIME].iter().flat_map(|row| self.client.registers().joints(row)).collect()
    }
}
