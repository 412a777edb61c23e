//! A page and its simulated arm for tests, in virtual time.

use block_programs::Program;
use exercises::Situation;
use protocol_core::time::Instant;
use sevenbot::Joint;
use sevenbot::map::{SPEED, TIME};

use crate::client::Client;
use crate::exercise::situation;
use crate::preview::exchange;
use crate::program::{ProgramProgress, ProgramRun, RunMode};
use crate::source::simulator::SimulatedSource;

/// The virtual time between two pictures of the page, in microseconds: 1/60 s.
const PICTURE_MICROS: f64 = 16_667.0;

/// A page and its simulated arm.
pub(crate) struct Tab {
    pub(crate) client: Client,
    pub(crate) arm: SimulatedSource,
}

impl Tab {
    /// A page with an arm that was switched on 100 pictures, 1.7 s, ago.
    pub(crate) fn new() -> Self {
        let mut tab = Self { client: Client::default(), arm: SimulatedSource::default() };
        tab.pass(100);
        assert!(tab.client.is_connected());
        tab
    }

    /// Exchanges bytes with the arm for this number of pictures, as the page does.
    pub(crate) fn pass(&mut self, pictures: u32) {
        (0..pictures).for_each(|_| exchange(&mut self.client, &mut self.arm, PICTURE_MICROS));
    }

    pub(crate) fn now(&self) -> Instant {
        self.arm.now()
    }

    pub(crate) fn situation(&self) -> Situation {
        situation(self.now(), self.client.registers(), self.arm.simulation().plant().world())
    }

    pub(crate) fn act(&mut self, action: &str) {
        self.arm.act(action.parse().expect("an action"));
    }

    pub(crate) fn begin(&self, workspace: &str, mode: RunMode) -> ProgramRun {
        let program = Program::parse(workspace).unwrap_or_else(|error| panic!("{error:?}"));
        ProgramRun::new(&program, mode, self.client.registers(), self.now())
    }

    /// Runs a program to its end. Calls `during` before each picture with its number, for example to inject a fault.
    pub(crate) fn run(
        &mut self,
        workspace: &str,
        mut during: impl FnMut(u32, &mut Self),
    ) -> (ProgramProgress, ProgramRun) {
        let mut run = self.begin(workspace, RunMode::Running);
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

    /// The registers that have to be the same after a program or park: speeds and times.
    pub(crate) fn registers(&self) -> Vec<u8> {
        [SPEED, TIME].iter().flat_map(|row| self.client.registers().joints(row)).collect()
    }
}
