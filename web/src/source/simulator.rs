//! The whole arm in this tab: controller, servos and gravity, in virtual time.

use arm_sim::{Action, Duration, Instant, Simulation, SimulationConfig};

use super::{LineState, Source};

/// A slice of virtual time. The line is polled after each.
const SLICE: Duration = Duration::from_millis(10);

/// A simulated arm.
pub struct SimulatedSource {
    simulation: Simulation,
    /// Virtual time that has passed in the browser, but not in the simulation yet, in microseconds.
    owed: f64,
}

impl Default for SimulatedSource {
    fn default() -> Self {
        let config = SimulationConfig { is_paced: false, ..SimulationConfig::default() };
        Self { simulation: Simulation::new(config), owed: 0.0 }
    }
}

impl SimulatedSource {
    /// The virtual time.
    #[must_use]
    pub const fn now(&self) -> Instant {
        self.simulation.now()
    }

    /// The simulation, to look at.
    #[must_use]
    pub const fn simulation(&self) -> &Simulation {
        &self.simulation
    }

    /// Lets virtual time pass, until `has_time` says that the page needs the processor. Time that did not fit is dropped.
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

    /// Does something to the arm: a fault, a hand, power.
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
    use crate::movement::Player;
    use crate::stop::StopProgress;
    use sevenbot::{Joint, Problem, ProblemKind};

    /// A client and an arm that was switched on a second ago.
    fn connected() -> (Client, SimulatedSource) {
        let (mut client, mut arm) = (Client::default(), SimulatedSource::default());
        pass(&mut client, &mut arm, 100);
        assert!(client.is_connected());
        (client, arm)
    }

    fn pass(client: &mut Client, arm: &mut SimulatedSource, frames: u32) {
        for _ in 0..frames {
            arm.send(&client.poll(arm.now()));
            arm.advance(16_667.0, || true);
            let bytes = arm.receive();
            client.receive(arm.now(), &bytes);
        }
    }

    #[test]
    fn a_target_moves_the_arm_and_a_stop_holds_it() {
        let (mut client, mut arm) = connected();
        let (address, values) = target_frame(client.registers(), 1, 150.25).expect("a target");
        client.write(arm.now(), address, &values);
        pass(&mut client, &mut arm, 12);
        let moving = client.state();
        assert_eq!((moving.targets[0], moving.moving), (150.25, 1));
        client.stop();
        pass(&mut client, &mut arm, 12);
        assert_eq!(client.stop_progress(), StopProgress::Holds);
        let held = client.state();
        assert!(held.targets[0] < 140.0 && held.moving == 0, "{held:?}");
    }

    /// A joint that is not measured yet holds only after it was measured: until then it goes where it was sent.
    #[test]
    fn a_stop_during_start_up_waits_for_every_joint() {
        let (mut client, mut arm) = (Client::default(), SimulatedSource::default());
        while !client.is_connected() {
            pass(&mut client, &mut arm, 1);
        }
        let (address, values) = target_frame(client.registers(), 1, 180.0).expect("a target");
        client.write(arm.now(), address, &values);
        client.stop();
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
        client.stop();
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
        let movement = "7bot-recording 2\n0 90 90 65 90 90 90 80 0\n1 110 90 65 90 90 90 80 1\n";
        let mut player = Player::new(movement, client.registers(), None, arm.now()).expect("a recording");
        let mut frames = 0;
        while player.poll(arm.now(), &mut client) {
            pass(&mut client, &mut arm, 1);
            frames += 1;
            assert!(frames < 1_000, "it does not end");
        }
        pass(&mut client, &mut arm, 60);
        let (state, pump) = (client.state(), client.registers().byte(&sevenbot::map::VACUUM_PUMP));
        assert!((state.angles()[0] - 110.0).abs() < 0.5, "{state:?}");
        assert_eq!((state.targets[0], state.faults, pump), (110.0, 0, 1));
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
