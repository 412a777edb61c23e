//! The rows: commands that talk to an arm, what each is asked to do, and the frame at which a fault during it begins.

use system_tests::registers::{EFFECTOR_TYPE, MOTOR_STATE, SPEED, TARGET_POSITION, VACUUM_PUMP};
use system_tests::relay::Moment;

/// A row of the table.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Command {
    /// The arguments. `FOLDER` is a folder with the files of [`FILES`].
    pub(crate) arguments: &'static str,
    /// Writes before the command: the address of the first register, and the values from there on.
    pub(crate) before: &'static [(u8, &'static [u8])],
    /// Virtual milliseconds from these writes to a fault that begins before the command, and from that fault to the command.
    pub(crate) pauses: (u64, u64),
    /// The angle of joint 2 at which the wall is, in degrees, if the fault is a wall.
    pub(crate) wall: u8,
    /// Does a stand support the arm, so that it does not fall without torque?
    pub(crate) is_supported: bool,
    /// Standard input.
    pub(crate) input: &'static str,
    /// The frame at which a fault during the command begins.
    pub(crate) moment: Moment,
    /// Virtual milliseconds from that fault until the relay passes frames on, so that the arm notices the fault first.
    pub(crate) notice: u64,
    pub(crate) asked: Asked,
}

/// What a command is asked to do.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Asked {
    /// To print something. There is no motion to check.
    Words,
    /// To bring joints to these angles in degrees.
    Reach(&'static [(usize, f64)]),
    /// To bring joints to these angles in degrees, and to leave the arm in motor state 0, damping.
    Park(&'static [(usize, f64)]),
    /// To give joints these targets, while the motors drive them.
    Targets(&'static [(usize, u8)]),
    /// To make the arm stand still.
    Stop,
    /// To make the motors hold the arm: motor state 1, with torque on all joints.
    Hold,
    /// To set a register: its address and its value.
    Register(u8, u8),
    /// To write a recording whose last pose is the pose of the arm at the end of the command.
    Record,
}

pub(crate) const FILES: [(&str, &str); 3] = [
    ("move.txt", "7bot-recording 1\n0 90 90 65 90 90 90 80 0\n1.5 110 105 65 90 90 90 80 0\n"),
    (
        "loop.txt",
        "7bot-recording 1\n0 90 90 65 90 90 90 80 0\n0.8 105 105 65 90 90 90 80 0\n\
         2.8 105 105 65 90 90 90 80 0\n3.6 94 94 65 90 90 90 80 0\n",
    ),
    ("settings.toml", SETTINGS),
];

const SETTINGS: &str =
    "format = 1\nchip-id = \"53494D000001\"\nfirmware = \"3.0\"\n[settings]\ndevice-id = 7\n";

/// 19 degrees per second.
const SLOW: (u8, &[u8]) = (SPEED, &[10; 7]);
/// 1.9 degrees per second.
const SLOWEST: (u8, &[u8]) = (SPEED, &[1; 7]);
const GOAL: &[(usize, f64)] = &[(1, 110.0), (2, 105.0)];
const TIP: &[(usize, f64)] = &[(1, 71.5), (2, 53.0)];
const LINES: &str = "0,90,90,65,90,90,90,80\n1.5,110,105,65,90,90,90,80\n";

/// A command that does not move the arm.
const fn still(arguments: &'static str, moment: Moment, asked: Asked) -> Command {
    let notice =
        if matches!(asked, Asked::Words | Asked::Register(..) | Asked::Targets(_)) { 1_000 } else { 0 };
    let (pauses, wall) = ((100, 1_500), 97);
    Command { arguments, before: &[], pauses, wall, is_supported: false, input: "", moment, notice, asked }
}

/// A command that moves an arm, slowly, and by default from the standard pose.
const fn moving(arguments: &'static str, moment: Moment, asked: Asked) -> Command {
    Command { before: &[SLOW], ..still(arguments, moment, asked) }
}

impl Command {
    /// The command runs with joints 1 and 2 away from the standard pose.
    const fn begins_away(self) -> Self {
        Self { before: &[(TARGET_POSITION, &[110, 105]), SLOW], pauses: (2_000, 1_500), ..self }
    }

    /// The command runs with the tool straight down, and the tip at (0, 185, 50) mm.
    const fn begins_tool_down(self) -> Self {
        Self {
            before: &[(TARGET_POSITION, &[90, 91, 110, 90, 135]), SLOW],
            pauses: (2_000, 1_500),
            wall: 80,
            ..self
        }
    }

    /// The command runs while the arm moves slowly.
    const fn during_a_move(self) -> Self {
        Self { before: &[SLOWEST, (TARGET_POSITION, &[130, 130])], pauses: (300, 700), ..self }
    }

    const fn in_state(self, before: &'static [(u8, &'static [u8])]) -> Self {
        Self { before, pauses: (500, 1_500), ..self }
    }

    /// The relay passes frames on directly after the fault, so that the arm has no time to notice it first.
    const fn at_once(self) -> Self {
        Self { notice: 0, ..self }
    }

    const fn supported(self) -> Self {
        Self { is_supported: true, ..self }
    }

    const fn with_input(self, input: &'static str) -> Self {
        Self { input, ..self }
    }
}

pub(crate) const COMMANDS: [Command; 37] = [
    still("info", Moment::Request(3), Asked::Words),
    still("status", Moment::Request(2), Asked::Words),
    still("where", Moment::Request(3), Asked::Words),
    still("get present-position", Moment::Request(2), Asked::Words),
    still("monitor --samples 10 --hz 10", Moment::Request(8), Asked::Words).at_once(),
    still("baud", Moment::Request(2), Asked::Words),
    still("backup -", Moment::Request(2), Asked::Words),
    still("calibrate --show", Moment::Request(2), Asked::Words),
    moving("pose 110 105 65 90 90 90 80", Moment::AfterTarget(1), Asked::Targets(&[(1, 110), (2, 105)])),
    moving("pose 110 105 65 90 90 90 80 --wait", Moment::AfterTarget(8), Asked::Reach(GOAL)),
    moving("pose 110.25 105.25 _ _ _ _ _ --wait", Moment::AfterTarget(8), Asked::Reach(GOAL)),
    moving("pose +20 +15 _ _ _ _ _ --time 8 --wait", Moment::AfterTarget(8), Asked::Reach(GOAL)),
    moving("home", Moment::AfterTarget(1), Asked::Targets(&[(1, 90), (2, 90)])).begins_away(),
    moving("home --wait", Moment::AfterTarget(8), Asked::Reach(&[(1, 90.0), (2, 90.0)])).begins_away(),
    moving("move-to 80 250 30", Moment::AfterTarget(1), Asked::Targets(&[(1, 72), (2, 53)]))
        .begins_tool_down(),
    moving("move-to 80 250 30 --wait", Moment::AfterTarget(8), Asked::Reach(TIP)).begins_tool_down(),
    moving("move-to 80 250 30 --straight", Moment::AfterTarget(60), Asked::Reach(TIP)).begins_tool_down(),
    still("stop", Moment::AfterTarget(1), Asked::Stop).during_a_move(),
    moving("park", Moment::AfterTarget(8), Asked::Park(&[(2, 90.0), (3, 0.0), (4, 90.0), (5, 48.0)]))
        .begins_away(),
    still("state", Moment::Request(2), Asked::Words),
    still("state servo", Moment::Request(5), Asked::Hold).in_state(&[(MOTOR_STATE, &[0])]),
    still("state damping --yes", Moment::Request(5), Asked::Register(MOTOR_STATE, 0)),
    still("state forceless --yes", Moment::Request(5), Asked::Register(MOTOR_STATE, 2)),
    still("vacuum on", Moment::Request(4), Asked::Register(VACUUM_PUMP, 1)),
    still("effector gripper", Moment::Request(4), Asked::Register(EFFECTOR_TYPE, 1)),
    moving("set target-position.2 105", Moment::AfterTarget(1), Asked::Targets(&[(2, 105)])),
    still("set speed 30", Moment::Request(6), Asked::Register(SPEED, 30)),
    still("set --unlock device-id 7", Moment::Request(8), Asked::Register(11, 7)),
    still("set motor-state 1", Moment::Request(5), Asked::Hold).in_state(&[(MOTOR_STATE, &[0])]),
    still("restore --yes FOLDER/settings.toml", Moment::Request(9), Asked::Register(11, 7)),
    still("calibrate --reset --yes", Moment::Request(9), Asked::Register(13, 0))
        .in_state(&[(28, &[0]), (13, &[3])]),
    still("record --yes --seconds 1 FOLDER/hand.txt", Moment::Reply(45), Asked::Record).supported(),
    still("record --driven --seconds 1 FOLDER/driven.txt", Moment::Reply(45), Asked::Record)
        .in_state(&[SLOWEST, (TARGET_POSITION, &[95, 95])]),
    moving("play FOLDER/move.txt", Moment::AfterTarget(40), Asked::Reach(GOAL)),
    moving("play FOLDER/loop.txt --loop=2", Moment::AfterTarget(160), Asked::Reach(&[(1, 94.0), (2, 94.0)])),
    moving("stream", Moment::AfterTarget(40), Asked::Reach(GOAL)).with_input(LINES),
    still("recover --yes", Moment::Request(6), Asked::Hold),
];
