//! Time that passed, and processor time of the programs that ran meanwhile. On a machine that does other things too,
//! only the second one tells what a step costs.

use std::fmt::{self, Display};
use std::fs;
use std::ops::Sub;
use std::sync::LazyLock;
use std::time::{Duration, Instant};

/// Ticks of a second in /proc: 100 on every Linux (USER_HZ).
const TICK: Duration = Duration::from_millis(10);

/// When the first time was taken.
static START: LazyLock<Instant> = LazyLock::new(Instant::now);

/// Both times, since the first look at the clock or between two looks.
#[derive(Clone, Copy)]
pub(crate) struct Times {
    /// On the clock.
    pub(crate) passed: Duration,
    /// On all processors, of all programs that have ended; `None` where the system does not tell.
    pub(crate) worked: Option<Duration>,
}

impl Times {
    /// Up to now.
    pub(crate) fn now() -> Self {
        let start = *START;
        Self {
            passed: start.elapsed(),
            worked: fs::read_to_string("/proc/self/stat").ok().and_then(|stat| worked(&stat)),
        }
    }

    /// Two cells of a table, in seconds.
    pub(crate) fn cells(&self) -> [String; 2] {
        let worked = self.worked.map_or("?".to_owned(), |worked| format!("{:.1}", worked.as_secs_f64()));
        [format!("{:.0}", self.passed.as_secs_f64()), worked]
    }
}

/// The processor time of the children that were waited for, and of theirs: proc_pid_stat(5), fields 16 and 17.
fn worked(stat: &str) -> Option<Duration> {
    // The second field is a name in brackets, which may hold anything.
    let (_, rest) = stat.rsplit_once(") ")?;
    let ticks = rest.split(' ').skip(13).take(2).map(|field| field.parse::<u64>().ok());
    let ticks = ticks.sum::<Option<u64>>()?;
    Some(TICK * u32::try_from(ticks).ok()?)
}

impl Sub for Times {
    type Output = Self;

    fn sub(self, before: Self) -> Self {
        let worked = self.worked.zip(before.worked).map(|(now, then)| now.saturating_sub(then));
        Self { passed: self.passed.saturating_sub(before.passed), worked }
    }
}

impl Display for Times {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "{:.0} s", self.passed.as_secs_f64())?;
        self.worked.map_or(Ok(()), |worked| write!(out, ", {:.1} s of processor time", worked.as_secs_f64()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_children_s_time_is_found_behind_any_name() {
        let stat = "12 (a) b) S 1 2 3 4 5 6 7 8 9 10 11 12 300 45 20 0";
        assert_eq!(worked(stat), Some(Duration::from_millis(3_450)));
        assert_eq!(worked("nonsense"), None);
    }
}
