//! The scenarios of worlds: which faults are injected, and how often.

use protocol_core::time::Duration;

use InjectedFault::{
    BusDisturbance, BusEcho, EmergencyStop, FlashWear, Hand, HostLinkCorruption, HostStopsReading, Panic,
    Payload, PowerCut, PowerCutInSave, Push, Restart, ServoFault, ServoRestart, ServoTrip, ShellStall, Thing,
    Wall, Watchdog,
};

/// A fault that a world injects. [`Scenario::faults`] lists those of a scenario.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InjectedFault {
    /// A servo becomes missing, late, garbled or stuck, or recovers.
    ServoFault,
    /// A servo restarts, as after a dip of its supply. Its torque is off after that.
    ServoRestart,
    /// The rates of corrupted and delayed frames on the servo bus change.
    BusDisturbance,
    /// The servo bus starts or stops to echo the controller's bytes.
    BusEcho,
    /// The rate of corrupted requests changes.
    HostLinkCorruption,
    /// The host stops reading for up to 5 s.
    HostStopsReading,
    /// The shell stalls for up to 5 s.
    ShellStall,
    /// The power of the controller and of the servos is cut.
    PowerCut,
    /// The power is cut during the next save.
    PowerCutInSave,
    /// The controller restarts. The servos keep their power.
    Restart,
    /// The controller hangs until its watchdog restarts it. The servos keep their power.
    Watchdog,
    /// The controller panics, damps the servos and restarts. The servos keep their power.
    Panic,
    /// A bit becomes unprogrammable in one of four cases, or a sector unerasable in one of forty.
    FlashWear,
    /// A hand turns a joint for up to 5 s. It releases the joint when motors may drive it.
    Hand,
    /// A wall is put in the way of a joint, stiff or soft, for up to a minute.
    Wall,
    /// A hand pushes a joint for up to a minute.
    Push,
    /// A thing is put between the claws.
    Thing,
    /// The payload changes to a weight of up to 500 g.
    Payload,
    /// Overload or heat is forced on a servo.
    ServoTrip,
    /// The supply of the servos is cut for 0.3, 3 or 30 s. The controller keeps its own.
    EmergencyStop,
}

/// A kind of world: which faults occur in it, and how often.
#[derive(Debug, PartialEq, Eq)]
pub struct Scenario {
    /// Its name on the command line.
    pub name: &'static str,
    /// Its description in the table of results.
    pub description: &'static str,
    /// The mean time between two faults.
    pub mean_interval: Duration,
    /// Each entry has the same probability, so a fault that is listed twice is twice as likely.
    pub faults: &'static [InjectedFault],
    /// The number of writes of settings in a thousand writes, apart from those for the extended block.
    pub settings_per_mille: u64,
    /// The number of starts in a hundred for which a power cut is planned. A start with too few operations of the flash leaves it
    /// to a later save.
    pub cut_starts_percent: u64,
}

const fn seconds(seconds: u64) -> Duration {
    Duration::from_millis(seconds * 1_000)
}

const NO_FAULTS: Scenario = Scenario {
    name: "",
    description: "",
    mean_interval: seconds(4),
    faults: &[],
    settings_per_mille: 20,
    cut_starts_percent: 0,
};

/// All scenarios. Consecutive seeds select them in turn.
pub static SCENARIOS: [Scenario; 10] = [
    Scenario {
        name: "calm",
        description: "no faults, and none reported",
        mean_interval: seconds(600),
        faults: &[Hand],
        ..NO_FAULTS
    },
    Scenario {
        name: "servos",
        description: "missing, late, garbled, stuck, restarting and echoing servos, joints turned by hand",
        faults: &[ServoFault, ServoFault, ServoRestart, BusEcho, Hand],
        ..NO_FAULTS
    },
    Scenario {
        name: "lines",
        description: "lost, doubled, wrong and late bytes on both lines, a host that does not read",
        faults: &[BusDisturbance, HostLinkCorruption, HostLinkCorruption, HostStopsReading],
        ..NO_FAULTS
    },
    Scenario {
        name: "stalls",
        description: "stalls of the shell of up to 5 s",
        mean_interval: seconds(2),
        faults: &[ShellStall, ShellStall, Hand, ServoFault],
        ..NO_FAULTS
    },
    Scenario {
        name: "holds",
        description: "restarts, hangs and panics of the controller alone, a disturbed servo bus, silent servos",
        mean_interval: seconds(3),
        faults: &[
            Restart,
            Restart,
            Watchdog,
            Panic,
            BusDisturbance,
            ServoFault,
            ServoFault,
            ServoRestart,
            Hand,
        ],
        ..NO_FAULTS
    },
    Scenario {
        name: "power",
        description: "power cuts at any time, during saves and starts",
        mean_interval: seconds(6),
        faults: &[PowerCut, PowerCutInSave, PowerCutInSave, Restart, Hand],
        settings_per_mille: 400,
        cut_starts_percent: 30,
    },
    Scenario {
        name: "worn",
        description: "power cuts, and a flash that wears out",
        mean_interval: seconds(6),
        faults: &[PowerCut, PowerCutInSave, PowerCutInSave, FlashWear],
        settings_per_mille: 400,
        cut_starts_percent: 30,
    },
    Scenario {
        name: "storm",
        description: "all faults",
        mean_interval: seconds(2),
        faults: &[
            ServoFault,
            ServoFault,
            ServoRestart,
            BusDisturbance,
            BusEcho,
            HostLinkCorruption,
            HostStopsReading,
            ShellStall,
            ShellStall,
            PowerCut,
            PowerCutInSave,
            Restart,
            Watchdog,
            Panic,
            Hand,
            Wall,
            Push,
            Thing,
            Payload,
            ServoTrip,
            EmergencyStop,
        ],
        settings_per_mille: 100,
        cut_starts_percent: 20,
    },
    Scenario {
        name: "obstacles",
        description: "walls, pushes, things between the claws, payloads of up to 500 g",
        faults: &[Wall, Wall, Push, Thing, Payload],
        ..NO_FAULTS
    },
    Scenario {
        name: "stops",
        description: "emergency stops of 0.3, 3 and 30 s, forced overload and heat, payloads, restarting servos",
        mean_interval: seconds(8),
        faults: &[EmergencyStop, ServoTrip, Payload, ServoRestart],
        ..NO_FAULTS
    },
];

/// The scenario with this name on the command line; `None` if there is none.
#[must_use]
pub fn find(name: &str) -> Option<&'static Scenario> {
    SCENARIOS.iter().find(|scenario| scenario.name == name)
}

/// The scenario that a seed selects.
#[must_use]
pub fn of_seed(seed: u64) -> &'static Scenario {
    let index = usize::try_from(seed % SCENARIOS.len() as u64).unwrap_or(0);
    let [first, ..] = &SCENARIOS;
    SCENARIOS.get(index).unwrap_or(first)
}
