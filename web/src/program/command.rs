//! Carries out the command of one block, until the arm has done it.

use std::time::Duration;

use block_programs::ProgramCommand;
use protocol_core::time::Instant;
use sevenbot::approach::ApproachRule;
use sevenbot::cartesian::{
    Guard, JointPath, StraightLine, StraightLineRequest, TargetResolution, TipRefusal, TipTarget, Vector,
};
use sevenbot::fine::{FineTargets, fine_frames};
use sevenbot::joints::frames_for;
use sevenbot::map::{EFFECTOR_TYPE, SPEED, TARGET_POSITION, TIME, VACUUM_PUMP, effector};
use sevenbot::moves::Pace;
use sevenbot::{Angle, FineAngle, Health, MoveTime, Snapshot, Speed};

use super::failure::ProgramFailure;
use super::joint_move::ProgramMove;
use crate::arm_state::breach_text;
use crate::client::Client;
use crate::confirmed::Confirmed;
use crate::movement::{PagePlayer, PlayProgress, PlayRefusal};
use crate::stop::since_start;

/// The current action of a program. A block may need several actions, one after the other.
#[derive(Debug)]
pub(super) enum RunStage {
    /// The program was not polled yet.
    Start,
    /// Waits until this round of reads is complete.
    Beginning(u64),
    /// The next block may begin.
    Ready,
    /// Waits until the arm has confirmed writes, and continues with the next action.
    Writing(Confirmed, Next),
    Moving(ProgramMove),
    Line(Box<PagePlayer>),
    /// Waits until this time since the start of the clock.
    Waiting(Duration),
    /// Waits until the arm has confirmed the last writes of the program.
    Closing(Confirmed),
}

/// The action after the arm has confirmed writes.
#[derive(Debug)]
pub(super) enum Next {
    /// The block is done.
    Nothing,
    /// Writes targets: the confirmed writes were their speeds and times, or the type of the effector.
    Targets(FineTargets),
    /// Waits until the joints have arrived: the confirmed writes were their targets.
    Arrival(FineTargets),
}

impl RunStage {
    pub(super) const fn may_move(&self) -> bool {
        matches!(self, Self::Writing(_, Next::Arrival(_)) | Self::Moving(_) | Self::Line(_))
    }

    /// Continues the action. Returns true when the whole command is done: an action may start another one of the same command.
    pub(super) fn is_done(&mut self, now: Instant, client: &mut Client) -> Result<bool, ProgramFailure> {
        match self {
            Self::Start | Self::Beginning(_) | Self::Ready => Ok(true),
            Self::Waiting(end) => Ok(since_start(now) >= *end),
            Self::Closing(written) => Ok(written.poll(now, client)?),
            Self::Moving(joints) => joints.poll(now, client),
            Self::Line(player) => match player.poll(now, client) {
                PlayProgress::Playing => Ok(false),
                PlayProgress::Played => Ok(true),
                PlayProgress::Failed(failure) => Err(ProgramFailure::Arm(failure)),
            },
            Self::Writing(written, next) => {
                if !written.poll(now, client)? {
                    return Ok(false);
                }
                let following = match next {
                    Next::Nothing => return Ok(true),
                    Next::Targets(targets) => write_targets(*targets, now, client),
                    Next::Arrival(targets) => {
                        Self::Moving(ProgramMove::new(*targets, now, client.registers()))
                    }
                };
                *self = following;
                Ok(false)
            }
        }
    }
}

/// Begins a command: writes its first frames, unless they come with the first poll, as for a line. Returns the action that
/// carries it out.
pub(super) fn begin(
    command: &ProgramCommand,
    now: Instant,
    client: &mut Client,
) -> Result<RunStage, ProgramFailure> {
    match command {
        ProgramCommand::Wait(time) => Ok(RunStage::Waiting(since_start(now) + *time)),
        ProgramCommand::Vacuum(is_on) => {
            let frames = vec![(VACUUM_PUMP.address, vec![u8::from(*is_on)])];
            Ok(RunStage::Writing(Confirmed::write(frames, now, client), Next::Nothing))
        }
        ProgramCommand::Joints { targets, pace } => Ok(set_pace(*targets, *pace, now, client)),
        ProgramCommand::Grip { claw } => {
            let frames = vec![(EFFECTOR_TYPE.address, vec![effector::GRIPPER])];
            let targets = [None, None, None, None, None, None, Some(*claw)];
            Ok(RunStage::Writing(Confirmed::write(frames, now, client), Next::Targets(targets)))
        }
        ProgramCommand::Tip { tip, tool, pace } => {
            let targets = tip_targets(*tip, *tool, *pace, client.registers())?;
            Ok(set_pace(targets, *pace, now, client))
        }
        ProgramCommand::Line { tip, tool, speed } => {
            let registers = client.registers();
            let line = line(*tip, *tool, *speed, registers)?;
            let player = PagePlayer::along(line.recording, registers, ApproachRule::Slowly, now);
            Ok(RunStage::Line(Box::new(player.map_err(refused_line)?)))
        }
    }
}

/// Writes the speed and the time of `pace`, if it has any, for the joints with a target. With a time only, also writes the
/// maximum speed. The targets follow when the arm has confirmed these.
fn set_pace(targets: FineTargets, pace: Pace, now: Instant, client: &mut Client) -> RunStage {
    let steps = |steps: u8| targets.map(|target| target.map(|_| steps));
    let speed = pace.speed.or(pace.time.map(|_| Speed::MAXIMUM));
    let speeds = speed.map(|speed| frames_for(&SPEED, &steps(speed.steps())));
    let times = pace.time.map(|time| frames_for(&TIME, &steps(time.steps())));
    let frames = speeds.into_iter().chain(times).flatten().collect();
    RunStage::Writing(Confirmed::write(frames, now, client), Next::Targets(targets))
}

fn write_targets(targets: FineTargets, now: Instant, client: &mut Client) -> RunStage {
    let frames = if client.registers().has_extended_block() {
        fine_frames(&targets)
    } else {
        frames_for(&TARGET_POSITION, &targets.map(|target| target.map(|angle| angle.nearest().degrees())))
    };
    RunStage::Writing(Confirmed::write(frames, now, client), Next::Arrival(targets))
}

/// The targets of the joints for a point of the tip.
///
/// # Errors
/// The point is out of reach, the guard of the workspace does not allow the path to it, or a joint was not measured.
fn tip_targets(
    tip: Vector,
    tool: Vector,
    pace: Pace,
    registers: &Snapshot,
) -> Result<FineTargets, ProgramFailure> {
    let guard = Guard::default();
    let target = TipTarget::guarded(tip, tool, Some(&guard)).map_err(|refusal| refused_tip(&refusal))?;
    let fine = target.in_hundredths(tip, tool).filter(|_| registers.has_extended_block());
    let whole = target.degrees.map(|degrees| Angle::from_register(degrees).into());
    let [one, two, three, four, five] = fine.map_or(whole, |fine| fine.angles);
    let to = [one, two, three, four, five].map(FineAngle::degrees);
    let from = measured(registers)?;
    let speeds = [pace.speed.unwrap_or(Speed::MAXIMUM); 5];
    let path = JointPath::at_pace(from, to, speeds, [pace.time.unwrap_or(MoveTime::NONE); 5]);
    guard.check_path(&path).map_err(|on_way| ProgramFailure::Refused {
        text: breach_text(&on_way.breach),
        details: on_way.to_string(),
    })?;
    Ok([Some(one), Some(two), Some(three), Some(four), Some(five), None, None])
}

/// The measured angles of joints 1 to 5, in degrees.
fn measured(registers: &Snapshot) -> Result<[f64; 5], ProgramFailure> {
    let mut angles = [0.0; 5];
    for (angle, joint) in angles.iter_mut().zip(&Health::new(registers).joints) {
        *angle = joint.position.ok_or(ProgramFailure::NotTold)?.degrees();
    }
    Ok(angles)
}

/// Plans a straight line of the tip from the present targets.
fn line(tip: Vector, tool: Vector, speed: f64, registers: &Snapshot) -> Result<StraightLine, ProgramFailure> {
    let is_fine = registers.has_extended_block();
    let request = StraightLineRequest {
        start: Health::new(registers).joints.map(|joint| joint.target),
        resolution: if is_fine { TargetResolution::Hundredths } else { TargetResolution::Degrees },
        vacuum: registers.byte(&VACUUM_PUMP) != 0,
        tip,
        tool,
        speed,
        guard: Some(Guard::default()),
    };
    StraightLine::plan(&request)
        .map_err(|error| ProgramFailure::Refused { text: "no-line", details: error.to_string() })
}

fn refused_tip(refusal: &TipRefusal) -> ProgramFailure {
    let text = match refusal {
        TipRefusal::Unreachable(_) => "unreachable",
        TipRefusal::Guarded(guarded) => breach_text(&guarded.breach),
    };
    ProgramFailure::Refused { text, details: refusal.to_string() }
}

fn refused_line(refusal: PlayRefusal) -> ProgramFailure {
    let details = match refusal {
        PlayRefusal::NoRecording(why) => why.to_string(),
        PlayRefusal::TooFar(far) => far.to_string(),
    };
    ProgramFailure::Refused { text: "no-line", details }
}
