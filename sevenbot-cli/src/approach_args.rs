//! `--approach`: what to do if the first point of a stream or a recording is not where the arm stands.

use std::time::Duration;

use clap::Args;
use sevenbot::approach::ApproachRule;

/// The option of the approach.
#[derive(Clone, Copy, Debug, Default, Args)]
pub(crate) struct ApproachArgs {
    /// First go smoothly to the first point, in this time: 0.1 to 60 s, or longer where a joint would exceed its speed.
    /// Without it a first point further than 5 degrees from where a joint stands is refused.
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    approach: Option<f64>,
}

fn seconds(text: &str) -> Result<f64, String> {
    let seconds = text.parse().ok().filter(|seconds| (0.1..=60.0).contains(seconds));
    seconds.ok_or_else(|| "a number from 0.1 to 60".to_owned())
}

impl ApproachArgs {
    /// The rule for the way to the first point.
    pub(crate) fn rule(self) -> ApproachRule {
        let time = self.approach.map(Duration::from_secs_f64);
        time.map_or(ApproachRule::Near, ApproachRule::Within)
    }
}
