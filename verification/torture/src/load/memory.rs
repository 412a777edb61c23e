//! The memory of another process over time, from `/proc` of Linux.

use std::fmt::{self, Display};
use std::fs;

/// The resident memory of a process over time, in KiB.
#[derive(Debug, Default)]
pub(super) struct Memory {
    first: Option<u64>,
    last: u64,
    max: u64,
}

impl Memory {
    /// Adds a measurement. Does nothing if the process has ended.
    pub(super) fn measure(&mut self, pid: u32) {
        let status = fs::read_to_string(format!("/proc/{pid}/status")).unwrap_or_default();
        let Some(resident) = resident_kib(&status) else { return };
        self.first.get_or_insert(resident);
        self.last = resident;
        self.max = self.max.max(resident);
    }
}

fn resident_kib(status: &str) -> Option<u64> {
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
    line.trim().strip_suffix("kB")?.trim().parse().ok()
}

impl Display for Memory {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.first {
            None => write!(out, "not measured"),
            Some(first) => write!(out, "{first} KiB at first, {} at last, {} at most", self.last, self.max),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_running_process_is_measured() {
        let mut memory = Memory::default();
        memory.measure(u32::MAX);
        assert_eq!(memory.to_string(), "not measured");
        memory.measure(std::process::id());
        assert!(memory.first.is_some_and(|kib| kib > 0 && kib == memory.last && kib == memory.max));
    }

    #[test]
    fn the_resident_memory_is_read_from_its_line() {
        assert_eq!(resident_kib("VmHWM:\t  20 kB\nVmRSS:\t   1234 kB\n"), Some(1_234));
        assert_eq!(resident_kib("VmRSS:\t   many kB\n"), None);
    }
}
