//! Real time, and processor time of child processes. On a busy machine, only the processor time shows the cost of a step.

use std::fmt::{self, Display};
use std::fs;
use std::ops::Sub;
use std::sync::LazyLock;
use std::time::{Duration, Instant};

/// The length of a tick in /proc: 1/100 s on every Linux (USER_HZ).
const TICK: Duration = Duration::from_millis(10);

/// The time of the first measurement.
static START: LazyLock<Instant> = LazyLock::new(Instant::now);

/// Real time and processor time since the first measurement, or between two measurements.
#[derive(Clone, Copy)]
pub(crate) struct Times {
    /// Real time.
    pub(crate) elapsed: Duration,
    /// Processor time of all child processes that have ended; `None` if the system does not report it.
    pub(crate) processor: Option<Duration>,
}

impl Times {
    /// The times since the first measurement.
    pub(crate) fn now() -> Self {
        let start = *START;
        Self {
            elapsed: start.elapsed(),
            processor: fs::read_to_string("/proc/self/stat").ok().and_then(|stat| processor(&stat)),
        }
    }

    /// Two cells of a table, in seconds.
    pub(crate) fn cells(&self) -> [String; 2] {
        let processor =
            self.processor.map_or("?".to_owned(), |processor| format!("{:.1}", processor.as_secs_f64()));
        [format!("{:.0}", self.elapsed.as_secs_f64()), processor]
    }
}

/// The processor time of the children that were waited for, and of their children: proc_pid_stat(5), fields 16 and 17.
fn processor(stat: &str) -> Option<Duration> {
    // The second field is a name in brackets, which may contain any characters.
    let (_, rest) = stat.rsplit_once(") ")?;
    let ticks = rest.split(' ').skip(13).take(2).map(|field| field.parse::<u64>().ok());
    let ticks = ticks.sum::<Option<u64>>()?;
    Some(TICK * u32::try_from(ticks).ok()?)
}

impl Sub for Times {
    type Output = Self;

    fn sub(self, before: Self) -> Self {
        let processor = self.processor.zip(before.processor).map(|(now, then)| now.saturating_sub(then));
        Self { elapsed: self.elapsed.saturating_sub(before.elapsed), processor }
    }
}

impl Display for Times {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "{:.0} s", self.elapsed.as_secs_f64())?;
        self.processor
            .map_or(Ok(()), |processor| write!(out, ", {:.1} s of processor time", processor.as_secs_f64()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn processor_time_is_found_after_any_name() {
        let stat = "12 (a) b) S 1 2 3 4 5 6 7 8 9 10 11 12 300 45 20 0";
        assert_eq!(processor(stat), Some(Duration::from_millis(3_450)));
        assert_eq!(processor("nonsense"), None);
    }
}
