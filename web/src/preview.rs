//! Runs a program of blocks on a separate simulated arm, as fast as the processor allows, and records its path as a
//! [`TimeLine`]. The page's own arm is not affected.

use block_programs::Program;
use protocol_core::time::Instant;
use sevenbot::Snapshot;
use sevenbot::map::{SPEED, TIME};

use crate::arm_state::{ArmState, target_frame};
use crate::client::Client;
use crate::program::{ProgramFailure, ProgramProgress, ProgramRun, RunMode};
use crate::source::Source;
use crate::source::simulator::SimulatedSource;
use crate::stop::since_start;
use crate::time_line::{Stand, TimeLine};

/// The program is polled at this interval of virtual time, in microseconds.
const STEP_MICROS: f64 = 20_000.0;
/// The number of steps between two moments of the time line: ten moments per second.
const STEPS_BETWEEN_STANDS: u32 = 5;
/// The longest preview: five minutes of virtual time.
const MOST_STEPS: u32 = 15_000;
/// The number of steps until a new arm drives its joints: 2 s.
const STEPS_TO_START: u32 = 100;
/// The number of further steps until a new arm has reached any pose: 3 s.
const STEPS_TO_POSE: u32 = 150;
/// A new arm has reached its pose if joints 1 to 6 are closer to it than this, in degrees: servos have play. Joint 7 may hold
/// something.
const NEAR: f32 = 3.0;

/// Why a preview ended.
#[derive(Clone, Debug, PartialEq)]
pub enum PreviewEnd {
    /// The program ran to its end.
    Over,
    /// The program would end early, for this reason.
    Failed(ProgramFailure),
    /// The program would take more than five minutes.
    TooLong,
}

/// A program that runs on a simulated arm of its own in virtual time, and fills a [`TimeLine`].
pub struct Preview {
    client: Client,
    arm: SimulatedSource,
    run: ProgramRun,
    begun: Instant,
    steps: u32,
    time_line: TimeLine,
}

impl Preview {
    /// Previews a program on a copy of this simulated arm, with its room and its faults.
    #[must_use]
    pub fn on_copy_of(arm: &SimulatedSource, program: &Program) -> Self {
        let (mut client, mut arm) = (Client::default(), arm.clone());
        // Drop the replies to requests of the page.
        drop(arm.receive());
        for _ in 0..STEPS_TO_START {
            if !client.is_connected() {
                pass(&mut client, &mut arm, 1);
            }
        }
        Self::begin(client, arm, program)
    }

    /// Previews a program on a new simulated arm on an empty table, with the pose, speeds and times of these registers. `None` if
    /// the simulated arm cannot reach the pose.
    #[must_use]
    pub fn on_new_arm(registers: &Snapshot, program: &Program) -> Option<Self> {
        let (mut client, mut arm) = (Client::default(), SimulatedSource::default());
        pass(&mut client, &mut arm, STEPS_TO_START);
        client.write(arm.now(), SPEED.address, &[0; 7]);
        let pose = ArmState::new(registers).angles();
        for (joint, angle) in (1..).zip(pose) {
            let (address, values) = target_frame(client.registers(), joint, angle)?;
            client.write(arm.now(), address, &values);
        }
        pass(&mut client, &mut arm, STEPS_TO_POSE);
        let there = client.state().angles();
        let is_near = pose.iter().zip(there).take(6).all(|(wanted, angle)| (wanted - angle).abs() < NEAR);
        for row in [SPEED, TIME] {
            client.write(arm.now(), row.address, &registers.joints(&row));
        }
        pass(&mut client, &mut arm, STEPS_BETWEEN_STANDS);
        is_near.then(|| Self::begin(client, arm, program))
    }

    fn begin(client: Client, arm: SimulatedSource, program: &Program) -> Self {
        let begun = arm.now();
        let run = ProgramRun::new(program, RunMode::Running, client.registers(), begun);
        Self { client, arm, run, begun, steps: 0, time_line: TimeLine::default() }
    }

    /// Runs the program until it ends, or until `has_time` returns false. Returns `None` if it has not ended yet.
    pub fn poll(&mut self, mut has_time: impl FnMut() -> bool) -> Option<PreviewEnd> {
        loop {
            let end = match self.run.poll(self.arm.now(), &mut self.client) {
                ProgramProgress::Running | ProgramProgress::Waiting if self.steps < MOST_STEPS => None,
                ProgramProgress::Running | ProgramProgress::Waiting => Some(PreviewEnd::TooLong),
                ProgramProgress::Over => Some(PreviewEnd::Over),
                ProgramProgress::Failed(failure) => Some(PreviewEnd::Failed(failure)),
            };
            if end.is_some() || self.steps.is_multiple_of(STEPS_BETWEEN_STANDS) {
                self.keep();
            }
            if end.is_some() {
                return end;
            }
            pass(&mut self.client, &mut self.arm, 1);
            self.steps += 1;
            if !has_time() {
                return None;
            }
        }
    }

    /// The recorded path of the arm.
    #[must_use]
    pub fn into_time_line(self) -> TimeLine {
        self.time_line
    }

    fn keep(&mut self) {
        self.time_line.push(Stand {
            time: since_start(self.arm.now()).saturating_sub(since_start(self.begun)),
            angles: self.client.state().angles(),
            block: self.run.block().cloned(),
        });
    }
}

fn pass(client: &mut Client, arm: &mut SimulatedSource, steps: u32) {
    (0..steps).for_each(|_| exchange(client, arm, STEP_MICROS));
}

/// Exchanges bytes between client and arm once, and lets `micros` microseconds of virtual time pass.
pub(crate) fn exchange(client: &mut Client, arm: &mut SimulatedSource, micros: f64) {
    arm.send(&client.poll(arm.now()));
    arm.advance(micros, || true);
    let bytes = arm.receive();
    client.receive(arm.now(), &bytes);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tab::Tab;

    fn end_of(mut preview: Preview) -> (PreviewEnd, TimeLine) {
        let mut turns = 0;
        loop {
            turns += 1;
            let mut steps = 0;
            let end = preview.poll(|| {
                steps += 1;
                steps < 100
            });
            if let Some(end) = end {
                return (end, preview.into_time_line());
            }
            assert!(turns < 1_000, "it does not end");
        }
    }

    fn example(name: &str) -> (String, Program) {
        let path = format!("{}/block-programs/examples/{name}.json", env!("CARGO_MANIFEST_DIR"));
        let workspace = std::fs::read_to_string(path).expect("an example");
        let program = Program::parse(&workspace).expect("a program");
        (workspace, program)
    }

    #[test]
    fn a_preview_ends_where_the_program_ends_and_moves_nothing() {
        for name in ["joints", "tip", "gripper", "functions"] {
            let (workspace, program) = example(name);
            let mut tab = Tab::new();
            let before = tab.angles();
            let on_copy = end_of(Preview::on_copy_of(&tab.arm, &program));
            let on_new = end_of(Preview::on_new_arm(tab.client.registers(), &program).expect("a pose"));
            assert_eq!(tab.angles(), before);
            tab.run(&workspace, |_, _| ());
            for (end, time_line) in [on_copy, on_new] {
                assert_eq!(end, PreviewEnd::Over, "{name}");
                let last = time_line.at(time_line.length()).expect("moments");
                for (angle, there) in last.angles.iter().zip(tab.angles()) {
                    assert!((f64::from(*angle) - there).abs() < 1.0, "{name}: {angle} and {there}");
                }
            }
        }
    }

    #[test]
    fn a_preview_meets_the_obstacles_of_the_arm() {
        let (_, program) = example("joints");
        let mut tab = Tab::new();
        tab.act("fault 1=stuck");
        let (end, time_line) = end_of(Preview::on_copy_of(&tab.arm, &program));
        assert!(matches!(end, PreviewEnd::Failed(_)), "{end:?}");
        assert!(time_line.at(time_line.length()).expect("moments").block.is_some(), "the block is named");
    }

    #[test]
    fn an_endless_program_has_a_preview_of_five_minutes() {
        let endless = r#"{"blocks": {"blocks": [{"type": "arm_start", "id": "start", "next": {"block":
            {"type": "controls_whileUntil", "id": "loop", "fields": {"MODE": "WHILE"},
             "inputs": {"BOOL": {"block": {"type": "logic_boolean", "fields": {"BOOL": "TRUE"}}}}}}}]}}"#;
        let program = Program::parse(endless).expect("a program");
        let (end, time_line) = end_of(Preview::on_copy_of(&Tab::new().arm, &program));
        assert_eq!((end, time_line.length().as_secs()), (PreviewEnd::TooLong, 300));
    }
}
