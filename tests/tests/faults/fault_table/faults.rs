//! The columns: what is wrong with the arm, and since when.

use serde_json::{Value, json};
use system_tests::control::Control;
use system_tests::relay::LineAction;

/// Virtual milliseconds before a fault, in which the arm carries out the frames that were sent before it.
const BEFORE: u64 = 20;

/// A column of the table.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Fault {
    pub(crate) name: &'static str,
    pub(crate) effect: Effect,
}

/// What happens, and when.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Effect {
    Nothing,
    /// A fault of the simulator that begins before the command.
    Before(&'static str),
    /// A wall in the way of joint 2.
    Wall,
    /// A fault of the simulator that begins during the command, and its duration in milliseconds; `None`: it does not end.
    During(&'static str, Option<u64>),
    /// A request to the simulator during the command.
    Request(&'static str),
    /// The servo of joint 2 lets go during the command: see [`trip`].
    Trip,
    /// The port is unplugged during the command.
    Unplugged,
    /// Some frames of each direction have a wrong checksum.
    Noise,
}

/// All columns. Joint 2 is one of the joints that move.
pub(crate) const FAULTS: [Fault; 15] = [
    fault("none", Effect::Nothing),
    fault("silent", Effect::Before("2=missing")),
    fault("falls silent", Effect::During("2=missing", None)),
    fault("garbled", Effect::Before("2=garbled")),
    fault("stuck", Effect::Before("2=stuck")),
    fault("wall", Effect::Wall),
    fault("lets go", Effect::Trip),
    fault("supply off", Effect::Before("supply=off")),
    fault("supply dips", Effect::During("supply=off", Some(300))),
    fault("supply back", Effect::During("supply=off", Some(1_200))),
    fault("restart", Effect::Request("restart")),
    fault("off and on", Effect::Request("cycle")),
    fault("halt", Effect::Request("halt")),
    fault("unplugged", Effect::Unplugged),
    fault("noise", Effect::Noise),
];

const fn fault(name: &'static str, effect: Effect) -> Fault {
    Fault { name, effect }
}

impl Fault {
    /// Sets the fault if it begins before the command. A wall is at `wall` degrees.
    pub(crate) fn begin(self, control: &mut Control, wall: u8) {
        let fault = match self.effect {
            Effect::Before(fault) => fault.to_owned(),
            Effect::Wall => format!("2=wall={wall}"),
            _ => return,
        };
        control.result(&json!({ "do": "fault", "fault": fault }));
    }

    /// Begins a fault during the command. Then `notice` milliseconds of virtual time pass, in which the arm notices it.
    pub(crate) fn act(self, control: &mut Control, notice: u64) -> LineAction {
        // First the arm carries out the frames that were sent before the fault.
        control.advance(BEFORE);
        let action = self.begin_now(control);
        if self.comes_during() && notice > 0 {
            control.advance(notice);
        }
        action
    }

    fn begin_now(self, control: &mut Control) -> LineAction {
        let request = match self.effect {
            Effect::Nothing | Effect::Before(_) | Effect::Wall | Effect::Noise => return LineAction::Nothing,
            Effect::Unplugged => return LineAction::Unplug,
            Effect::During(fault, None) => json!({ "do": "fault", "fault": fault }),
            Effect::During(fault, Some(time)) => json!({ "do": "fault", "fault": fault, "for_ms": time }),
            Effect::Trip => return trip(control),
            Effect::Request("cycle") => json!({ "do": "power", "to": "cycle" }),
            Effect::Request(request) => json!({ "do": request }),
        };
        let _: Value = control.result(&request);
        LineAction::Nothing
    }

    /// Does the fault begin at a frame of the command?
    pub(crate) const fn comes_during(self) -> bool {
        !matches!(self.effect, Effect::Nothing | Effect::Before(_) | Effect::Wall | Effect::Noise)
    }

    /// Does the fault begin at a frame of the command and end after a given time?
    pub(crate) const fn passes(self) -> bool {
        matches!(self.effect, Effect::During(_, Some(_)))
    }

    pub(crate) const fn is_noise(self) -> bool {
        matches!(self.effect, Effect::Noise)
    }
}

/// Makes the servo of joint 2 let go: by an overload, or by heat if the servo has no torque and refuses the overload.
fn trip(control: &mut Control) -> LineAction {
    if control.ask(&json!({ "do": "trip", "joint": 2 }))["ok"].is_null() {
        control.result(&json!({ "do": "trip", "joint": 2, "alarm": "heat" }));
    }
    LineAction::Nothing
}
