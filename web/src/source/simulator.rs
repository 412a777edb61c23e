//! A simulated arm in this tab, with controller, servos and gravity, in virtual time.

use arm_sim::scene::Scene;
use arm_sim::{Action, Duration, Instant, Simulation, SimulationConfig};

use super::{LineState, Source};

/// The simulation advances in slices of this virtual time.
const SLICE: Duration = Duration::from_millis(10);

/// A simulated arm. A clone is independent of the original.
#[derive(Clone)]
pub struct SimulatedSource {
    simulation: Simulation,
    /// The virtual time by which the simulation lags behind, in microseconds.
    owed: f64,
}

impl Default for SimulatedSource {
    /// An arm on an empty table.
    fn default() -> Self {
        let config = SimulationConfig { is_paced: false, ..SimulationConfig::default() };
        let mut simulation = Simulation::new(config);
        simulation.act(Action::Scene(Some(Scene::default())));
        Self { simulation, owed: 0.0 }
    }
}

impl SimulatedSource {
    /// The present virtual time.
    #[must_use]
    pub const fn now(&self) -> Instant {
        self.simulation.now()
    }

    /// The simulation, for reading its state.
    #[must_use]
    pub const fn simulation(&self) -> &Simulation {
        &self.simulation
    }

    /// Advances the simulation by this virtual time, in microseconds, or until `has_time` returns false. Keeps at
    /// most one slice of the remaining time, and drops the rest.
    pub fn advance(&mut self, virtual_micros: f64, mut has_time: impl FnMut() -> bool) {
        self.owed += virtual_micros;
        let slice = SLICE.as_micros();
        let micros = f64::from(u32::try_from(slice).unwrap_or(u32::MAX));
        while self.owed >= micros && has_time() {
            self.simulation.advance(SLICE);
            self.owed -= micros;
        }
        self.owed = self.owed.min(micros);
    }

    /// Carries out an action on the arm, such as a fault, a move by hand or a power cycle.
    pub fn act(&mut self, action: Action) {
        self.simulation.act(action);
    }
}

impl Source for SimulatedSource {
    fn send(&mut self, bytes: &[u8]) {
        self.simulation.send(bytes);
    }

    fn receive(&mut self) -> Vec<u8> {
        self.simulation.take_received()
    }

    fn state(&self) -> LineState {
        LineState::Open
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arm_state::target_frame;
    use crate::client::Client;
    use crate::movement::{PagePlayer, PlayFailure, PlayProgress};
    use crate::preview::exchange;
    use crate::stop::StopProgress;
    use sevenbot::map::{SET_POINT_PERIOD, SPEED, WATCHDOG_ACTION};
    use sevenbot::{Joint, Problem, ProblemKind};

    /// A client and an arm that was switched on 100 pictures, 1.7 s, ago.
    fn connected() -> (Client, SimulatedSource) {
        let (mut client, mut arm) = (Client::default(), SimulatedSource::default());
        pass(&mut client, &mut arm, 100);
        assert!(client.is_connected());
        (client, arm)
    }

    fn pass(client: &mut Client, arm: &mut SimulatedSource, frames: u32) {
        (0..frames).for_each(|_| exchange(client, arm, 16_667.0));
    }

    /// As [`pass`], but discards all bytes that the arm sends.
    fn pass_without_replies(client: &mut Client, arm: &mut SimulatedSource, frames: u32) {
        for _ in 0..frames {
            arm.send(&client.poll(arm.now()));
            arm.advance(16_667.0, || true);
            arm.receive();
            client.receive(arm.now(), &[]);
        }
    }

    /// The true angle of joint 1, in degrees.
    fn base(arm: &SimulatedSource) -> f64 {
        f64::from(arm.simulation().plant().angle(Joint::ALL[0])) / 1e3
    }

    #[test]
    fn a_stop_acts_at_once_although_no_reply_comes() {
        let (mut client, mut arm) = connected();
        let (address, values) = target_frame(client.registers(), 1, 175.0).expect("a target");
        client.write(arm.now(), address, &values);
        pass(&mut client, &mut arm, 12);
        client.stop(arm.now(), None);
        let bytes = client.poll(arm.now());
        assert_eq!(bytes.get(..5), Some(&[0xAA, 0x77, 6, 184, 2][..]), "the stop is the first: {bytes:?}");
        arm.send(&bytes);
        pass_without_replies(&mut client, &mut arm, 30);
        let stopped = base(&arm);
        // The joint returns to its last known position, at 1.9 degrees per second.
        pass_without_replies(&mut client, &mut arm, 300);
        let rested = base(&arm);
        assert_eq!(client.stop_progress(), StopProgress::Verifying, "nothing has confirmed it");
        assert!(stopped < 140.0 && (0.0..5.0).contains(&(stopped - rested)), "from {stopped} to {rested}");
        pass(&mut client, &mut arm, 60);
        assert_eq!(client.stop_progress(), StopProgress::Holds);
        let speeds = client.registers().joints(&SPEED);
        assert_eq!((speeds, client.state().moving), ([60; 7], 0), "the speeds are those of before");
        assert!((base(&arm) - rested).abs() < 0.5, "from {rested} to {}", base(&arm));
    }

    /// Plays a movement of joint 1 to its end. Calls `during` before each picture with its number, for example to inject a fault.
    fn play(
        client: &mut Client,
        arm: &mut SimulatedSource,
        mut during: impl FnMut(u32, &mut SimulatedSource),
    ) -> PlayProgress {
        let movement = "7bot-recording 2\n0 90 90 65 90 90 90 80 0\n3 120 90 65 90 90 90 80 1\n";
        let mut player = PagePlayer::new(movement, client.registers(), None, arm.now()).expect("a recording");
        for pictures in 0..1_000 {
            during(pictures, arm);
            match player.poll(arm.now(), client) {
                PlayProgress::Playing => pass(client, arm, 1),
                end => {
                    pass(client, arm, 20);
                    return end;
                }
            }
        }
        panic!("it does not end");
    }

    #[test]
    fn a_movement_ends_where_the_arm_does_not_carry_it_out() {
        let reason = |action: &'static str| {
            let (mut client, mut arm) = connected();
            let end = play(&mut client, &mut arm, |pictures, arm| {
                if pictures == 60 {
                    arm.act(action.parse().expect("an action"));
                }
            });
            let PlayProgress::Failed(failure) = end else { panic!("{action}: {end:?}") };
            crate::words::play_failure(crate::texts::Language::English, &failure)
        };
        for (action, word) in [
            ("fault 3=missing", "Joint 3 does not answer"),
            ("fault 1=stuck", "Joint 1 is blocked"),
            ("fault supply=off", "does not answer"),
            ("power-cycle", "restarted"),
            ("halt", "does not answer"),
        ] {
            assert!(reason(action).contains(word), "{action}: {}", reason(action));
        }
    }

    #[test]
    fn a_page_that_pauses_ends_its_movement() {
        let (mut client, mut arm) = connected();
        let mut at = 0.0;
        let end = play(&mut client, &mut arm, |pictures, arm| {
            if pictures == 60 {
                arm.advance(7e6, || true);
                while arm.now() < Instant::from_micros(8_000_000) {
                    arm.advance(10_000.0, || true);
                }
                at = base(arm);
            }
        });
        assert!(matches!(end, PlayProgress::Failed(PlayFailure::Paused(_))), "{end:?}");
        assert!((base(&arm) - at).abs() < 0.5, "from {at} to {}", base(&arm));
    }

    #[test]
    fn a_target_moves_the_arm_and_a_stop_holds_it() {
        let (mut client, mut arm) = connected();
        let (address, values) = target_frame(client.registers(), 1, 150.25).expect("a target");
        client.write(arm.now(), address, &values);
        pass(&mut client, &mut arm, 12);
        let moving = client.state();
        assert_eq!((moving.targets[0], moving.moving), (150.25, 1));
        client.stop(arm.now(), None);
        pass(&mut client, &mut arm, 12);
        assert_eq!(client.stop_progress(), StopProgress::Holds);
        let held = client.state();
        assert!(held.targets[0] < 140.0 && held.moving == 0, "{held:?}");
    }

    /// During start-up (D12) a joint that is not measured yet has no position to hold. The stop has to wait for it, because the
    /// joint would later move to the target that was written before the stop.
    #[test]
    fn a_stop_during_start_up_waits_for_every_joint() {
        let (mut client, mut arm) = (Client::default(), SimulatedSource::default());
        while !client.is_connected() {
            pass(&mut client, &mut arm, 1);
        }
        let (address, values) = target_frame(client.registers(), 1, 180.0).expect("a target");
        client.write(arm.now(), address, &values);
        client.stop(arm.now(), None);
        pass(&mut client, &mut arm, 100);
        assert_eq!(client.stop_progress(), StopProgress::Holds);
        let held = client.state();
        assert!((held.targets[0] - 90.0).abs() < 1.0 && held.moving == 0, "{held:?}");
    }

    #[test]
    fn a_stop_of_a_limp_arm_writes_nothing() {
        let (mut client, mut arm) = connected();
        client.write(arm.now(), sevenbot::map::MOTOR_STATE.address, &[2]);
        pass(&mut client, &mut arm, 10);
        client.stop(arm.now(), None);
        pass(&mut client, &mut arm, 10);
        assert_eq!(client.stop_progress(), StopProgress::NotDriven);
    }

    #[test]
    fn a_missing_servo_is_seen_and_a_silent_arm_too() {
        let (mut client, mut arm) = connected();
        arm.act("fault 3=missing".parse().expect("an action"));
        pass(&mut client, &mut arm, 60);
        assert_eq!(client.state().missing, 0b100);
        arm.act("halt".parse().expect("an action"));
        pass(&mut client, &mut arm, 120);
        assert!(!client.is_connected());
    }

    #[test]
    fn a_servo_that_is_stuck_is_told_from_those_that_work() {
        let (mut client, mut arm) = connected();
        arm.act("fault 3=stuck".parse().expect("an action"));
        for (joint, degrees) in [(2, 80.0), (3, 90.0), (7, 20.0)] {
            let (address, values) = target_frame(client.registers(), joint, degrees).expect("a target");
            client.write(arm.now(), address, &values);
        }
        for _ in 0..240 {
            pass(&mut client, &mut arm, 1);
            let state = client.state();
            assert!(matches!(state.stalled, 0 | 0b100) && state.faults == 0, "{state:?}");
        }
        let state = client.state();
        let blocked = Problem { kind: ProblemKind::Blocked, joint: Joint::new(3) };
        assert_eq!((state.stalled, &state.problems), (0b100, &vec![blocked]));
    }

    #[test]
    fn a_movement_is_played_to_its_end() {
        let (mut client, mut arm) = connected();
        assert_eq!(play(&mut client, &mut arm, |_, _| ()), PlayProgress::Played);
        let registers = client.registers();
        let stream = registers.part(sevenbot::Span::between(&SET_POINT_PERIOD, &WATCHDOG_ACTION));
        assert_eq!((stream.values, registers.joints(&SPEED)), (vec![0; 4], [60; 7]), "as before");
        let (state, pump) = (client.state(), client.registers().byte(&sevenbot::map::VACUUM_PUMP));
        assert!((state.angles()[0] - 120.0).abs() < 0.5, "{state:?}");
        assert_eq!((state.targets[0], state.faults, pump), (120.0, 0, 1));
    }

    #[test]
    fn time_that_does_not_fit_is_dropped() {
        let mut arm = SimulatedSource::default();
        let mut slices = 3;
        arm.advance(1e9, || {
            slices -= 1;
            slices >= 0
        });
        assert_eq!(arm.now(), Instant::from_micros(30_000));
        arm.advance(0.0, || true);
        assert!(arm.now() <= Instant::from_micros(40_000));
    }
}
