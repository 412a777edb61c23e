//! How much memory another process holds, and how that changes. Linux: reads `/proc`.

use std::fmt::{self, Display};
use std::fs;

/// The resident memory of a process over time, in KiB.
#[derive(Debug, Default)]
pub(super) struct Memory {
    first: Option<u64>,
    last: u64,
    most: u64,
}

impl Memory {
    /// Looks at a process. One that is gone changes nothing.
    pub(super) fn look(&mut self, pid: u32) {
        let status = fs::read_to_string(format!("/proc/{pid}/status")).unwrap_or_default();
        let Some(resident) = resident_kib(&status) else { return };
        self.first.get_or_insert(resident);
        self.last = resident;
        self.most = self.most.max(resident);
    }
}

fn resident_kib(status: &str) -> Option<u64> {
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
    line.trim().strip_suffix("kB")?.trim().parse().ok()
}

impl Display for Memory {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.first {
            None => write!(out, "not watched"),
            Some(first) => write!(out, "{first} KiB at first, {} at last, {} at most", self.last, self.most),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn this_process_holds_memory_and_one_that_is_not_there_does_not() {
        let mut memory = Memory::default();
        memory.look(u32::MAX);
        assert_eq!(memory.to_string(), "not watched");
        memory.look(std::process::id());
        assert!(memory.first.is_some_and(|kib| kib > 0 && kib == memory.last && kib == memory.most));
    }

    #[test]
    fn the_resident_memory_is_one_line_of_many() {
        assert_eq!(resident_kib("VmHWM:\t  20 kB\nVmRSS:\t   1234 kB\n"), Some(1_234));
        assert_eq!(resident_kib("VmRSS:\t   many kB\n"), None);
    }
}
