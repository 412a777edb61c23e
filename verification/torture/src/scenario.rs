//! The worlds there are: what goes wrong in them, and how often.

use protocol_core::time::Duration;

/// Something that goes wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Trouble {
    /// A servo goes missing, is late, garbled or stuck; or it is well again.
    Servo,
    /// A servo starts again.
    Reset,
    /// The servo bus is disturbed more, or less: lost, doubled, wrong, late bytes.
    Bus,
    /// The controller hears itself on the servo bus, or no longer.
    Echo,
    /// The host's line is disturbed more, or less.
    Line,
    /// The host does not read for a while.
    Deaf,
    /// The shell is late, by up to seconds.
    Stall,
    /// The power is cut, at once.
    Cut,
    /// The power is cut while settings are saved.
    SaveCut,
    /// The controller starts again; the servos keep their power.
    Restart,
    /// The controller hangs until its watchdog restarts it; likewise.
    Watchdog,
    /// The controller panics, damps the servos and starts again; likewise.
    Fault,
    /// A sector does not erase, or a cell does not program, from now on.
    Wear,
    /// Somebody turns a joint by hand.
    Hand,
}

/// A kind of world.
#[derive(Debug, PartialEq, Eq)]
pub struct Scenario {
    /// What it is called on the command line.
    pub name: &'static str,
    /// What happens in it.
    pub about: &'static str,
    /// One trouble in this time, on average.
    pub every: Duration,
    /// Which; what stands here twice happens twice as often.
    pub troubles: &'static [Trouble],
    /// How many of a thousand writes change settings.
    pub settings_per_mille: u64,
    /// How many of a hundred starts are cut.
    pub cut_starts_percent: u64,
}

const fn seconds(seconds: u64) -> Duration {
    Duration::from_millis(seconds * 1_000)
}

/// All of them. Worlds take turns.
pub static SCENARIOS: [Scenario; 8] = [
    Scenario {
        name: "calm",
        about: "nothing goes wrong, and nothing may look as if it did",
        every: seconds(600),
        troubles: &[Trouble::Hand],
        settings_per_mille: 20,
        cut_starts_percent: 0,
    },
    Scenario {
        name: "servos",
        about: "servos missing, late, garbled, stuck, starting again, echoing, turned by hand",
        every: seconds(4),
        troubles: &[Trouble::Servo, Trouble::Servo, Trouble::Reset, Trouble::Echo, Trouble::Hand],
        settings_per_mille: 20,
        cut_starts_percent: 0,
    },
    Scenario {
        name: "lines",
        about: "lost, doubled, wrong and late bytes on both lines, a host that does not read",
        every: seconds(4),
        troubles: &[Trouble::Bus, Trouble::Line, Trouble::Line, Trouble::Deaf],
        settings_per_mille: 20,
        cut_starts_percent: 0,
    },
    Scenario {
        name: "stalls",
        about: "the shell is late, by up to seconds",
        every: seconds(2),
        troubles: &[Trouble::Stall, Trouble::Stall, Trouble::Hand, Trouble::Servo],
        settings_per_mille: 20,
        cut_starts_percent: 0,
    },
    Scenario {
        name: "holds",
        about: "restarts, hangs and panics of the controller alone, a disturbed servo bus, silent servos",
        every: seconds(3),
        troubles: &[
            Trouble::Restart,
            Trouble::Restart,
            Trouble::Watchdog,
            Trouble::Fault,
            Trouble::Bus,
            Trouble::Servo,
            Trouble::Servo,
            Trouble::Reset,
            Trouble::Hand,
        ],
        settings_per_mille: 20,
        cut_starts_percent: 0,
    },
    Scenario {
        name: "power",
        about: "power cuts at any instant, in saves, in starts",
        every: seconds(6),
        troubles: &[Trouble::Cut, Trouble::SaveCut, Trouble::SaveCut, Trouble::Restart, Trouble::Hand],
        settings_per_mille: 400,
        cut_starts_percent: 30,
    },
    Scenario {
        name: "worn",
        about: "power cuts, on a flash that wears out",
        every: seconds(6),
        troubles: &[Trouble::Cut, Trouble::SaveCut, Trouble::SaveCut, Trouble::Wear],
        settings_per_mille: 400,
        cut_starts_percent: 30,
    },
    Scenario {
        name: "storm",
        about: "everything at once",
        every: seconds(2),
        troubles: &[
            Trouble::Servo,
            Trouble::Servo,
            Trouble::Reset,
            Trouble::Bus,
            Trouble::Echo,
            Trouble::Line,
            Trouble::Deaf,
            Trouble::Stall,
            Trouble::Stall,
            Trouble::Cut,
            Trouble::SaveCut,
            Trouble::Restart,
            Trouble::Watchdog,
            Trouble::Fault,
            Trouble::Hand,
        ],
        settings_per_mille: 100,
        cut_starts_percent: 20,
    },
];

/// The scenario with this name.
#[must_use]
pub fn find(name: &str) -> Option<&'static Scenario> {
    SCENARIOS.iter().find(|scenario| scenario.name == name)
}

/// The scenario of a seed, where none was asked for.
#[must_use]
pub fn of_seed(seed: u64) -> &'static Scenario {
    let place = usize::try_from(seed % SCENARIOS.len() as u64).unwrap_or(0);
    let [first, ..] = &SCENARIOS;
    SCENARIOS.get(place).unwrap_or(first)
}
