//! Real time and processor time of a child process. On a busy machine, only the processor time shows the cost of a step.

use std::fmt::{self, Display};
use std::fs;
use std::process::Child;
use std::thread::sleep;
use std::time::{Duration, Instant};

use rustix::process::{Pid, WaitId, WaitIdOptions, WaitOptions, waitid};

use crate::run::TaskResult;

/// The length of a tick in /proc: 1/100 s (USER_HZ).
const TICK: Duration = Duration::from_millis(10);

/// How long the processes of a step may outlive the step.
const PATIENCE: Duration = Duration::from_secs(10);

/// The times of a child process or of work in this process, with the child processes.
#[derive(Clone, Copy)]
pub(crate) struct Times {
    /// Real time.
    pub(crate) elapsed: Duration,
    /// Processor time; `None` if the system does not report it.
    pub(crate) processor: Option<Duration>,
}

impl Times {
    /// Runs `work` in this process, and measures it. Children count if they have ended and were waited for.
    pub(crate) fn of<T>(work: impl FnOnce() -> T) -> (Self, T) {
        let (start, before) = (Instant::now(), own_processor_time());
        let outcome = work();
        let processor = own_processor_time().zip(before).map(|(after, before)| after.saturating_sub(before));
        (Self { elapsed: start.elapsed(), processor }, outcome)
    }

    /// Waits for the end of a child, and returns its processor time. The child has to be waited for again.
    pub(crate) fn processor_of(child: &Child) -> TaskResult<Option<Duration>> {
        let pid = Pid::from_child(child);
        waitid(WaitId::Pid(pid), WaitIdOptions::EXITED | WaitIdOptions::NOWAIT)?;
        let stat = fs::read_to_string(format!("/proc/{}/stat", child.id()));
        Ok(stat.ok().and_then(|stat| processor(&stat)))
    }

    /// Two cells of a table, in seconds.
    pub(crate) fn cells(&self) -> [String; 2] {
        let processor =
            self.processor.map_or("?".to_owned(), |processor| format!("{:.1}", processor.as_secs_f64()));
        [format!("{:.0}", self.elapsed.as_secs_f64()), processor]
    }
}

/// Makes this process the parent of descendants that lose their parent, such as the processes of a browser. Then their processor
/// time counts, after [`wait_for_orphans`].
#[cfg(target_os = "linux")]
pub(crate) fn adopt_orphans() -> TaskResult {
    Ok(rustix::process::set_child_subreaper(Some(rustix::process::getpid()))?)
}

/// Does nothing on other systems.
#[cfg(not(target_os = "linux"))]
pub(crate) fn adopt_orphans() -> TaskResult {
    Ok(())
}

/// Waits for the end of all processes that this one has started or adopted, for [`PATIENCE`] at most.
pub(crate) fn wait_for_orphans() {
    let deadline = Instant::now() + PATIENCE;
    while Instant::now() < deadline {
        match rustix::process::wait(WaitOptions::NOHANG) {
            Ok(Some(_)) => {}
            Ok(None) => sleep(TICK),
            Err(_) => return,
        }
    }
    println!("processes that this step has started still run");
}

/// The processor time of this process so far.
fn own_processor_time() -> Option<Duration> {
    fs::read_to_string("/proc/self/stat").ok().and_then(|stat| processor(&stat))
}

/// The processor time of a process and of its children that it waited for: proc_pid_stat(5), fields 14 to 17.
fn processor(stat: &str) -> Option<Duration> {
    // The second field is a name in brackets, which may contain any characters.
    let (_, rest) = stat.rsplit_once(") ")?;
    let ticks = rest.split(' ').skip(11).take(4).map(|field| field.parse::<u64>().ok());
    let ticks = ticks.sum::<Option<u64>>()?;
    Some(TICK * u32::try_from(ticks).ok()?)
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
        let stat = "12 (a) b) S 1 2 3 4 5 6 7 8 9 10 100 20 300 45 20 0";
        assert_eq!(processor(stat), Some(Duration::from_millis(4_650)));
        assert_eq!(processor("nonsense"), None);
    }
}
