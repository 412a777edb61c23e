//! `model`: the arm's model for robotics programs, to standard output or a file.

use std::io::{self, Write};
use std::path::PathBuf;

use clap::{Args, ValueEnum};

use crate::command_error::CommandError;
use crate::output_file::{ForceArg, OutputFile, stdout_for};

/// Write the arm's model: URDF, MJCF or glTF.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  sevenbot model --format urdf > 7bot.urdf
  sevenbot model --format mjcf --out 7bot.xml
  sevenbot model --format glb --out 7bot.glb

Needs no arm. Metres and radians; x forward, y to the left, z up (REP-103). All
joints are 0 in the pose 90 90 65 90 90 90: an angle is (register - zero)
degrees. The dimensions are exact, the shapes are symbolic, and masses are not
measured. Joint 7, the claw, moves no point and is left out.

The arm has a parallelogram. MJCF closes it by an equality constraint. URDF
cannot: there, the elbow is computed from joint 2 by a mimic joint, and joint
3 turns the forearm from the horizontal, as in the arm. glTF shows the
straight pose.")]
pub(crate) struct ModelArgs {
    /// The format.
    #[arg(long)]
    format: ModelFormat,
    /// The file to write; standard output if not given.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    #[command(flatten)]
    force: ForceArg,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum ModelFormat {
    /// Unified Robot Description Format, for ROS.
    Urdf,
    /// The format of MuJoCo.
    Mjcf,
    /// Binary glTF, for viewers.
    Glb,
}

impl ModelFormat {
    fn bytes(self) -> io::Result<Vec<u8>> {
        match self {
            Self::Urdf => arm_model::urdf().map(String::into_bytes),
            Self::Mjcf => arm_model::mjcf().map(String::into_bytes),
            Self::Glb => arm_model::glb(),
        }
    }
}

pub(crate) fn run(args: &ModelArgs) -> Result<(), CommandError> {
    let bytes = args.format.bytes()?;
    if let Some(path) = &args.out {
        return OutputFile::open(path, None, args.force)?.write(&bytes);
    }
    let mut stdout = stdout_for((args.format == ModelFormat::Glb).then_some("glb"))?;
    stdout.write_all(&bytes)?;
    Ok(stdout.flush()?)
}
