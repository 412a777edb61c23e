//! A data cache in front of the cells. A read loads a whole line. A write updates the cells and, if its line is loaded, the line.
//!
//! So a loaded line shows the written value even if the cells did not change. To verify a write, flush the cache before the read.

use std::collections::VecDeque;

/// A cache with `LINES` lines of `LINE` bytes. A new line replaces the least recently used one.
#[derive(Clone, Debug, Default)]
pub struct Cache<const LINE: usize, const LINES: usize> {
    lines: VecDeque<(usize, [u8; LINE])>,
}

impl<const LINE: usize, const LINES: usize> Cache<LINE, LINES> {
    /// An empty cache. `LINE` must be a power of two, and `LINES` at least 1.
    #[must_use]
    pub const fn new() -> Self {
        const { assert!(LINE.is_power_of_two() && LINES > 0) };
        Self { lines: VecDeque::new() }
    }

    /// Reads `N` bytes of one line at `address`. Loads the line from `cells` if the cache does not hold it.
    pub fn read<const N: usize>(&mut self, address: usize, cells: &[u8]) -> [u8; N] {
        let start = address & !(LINE - 1);
        let line = self.take(start).unwrap_or_else(|| chunk(cells, start));
        self.lines.push_front((start, line));
        self.lines.truncate(LINES);
        chunk(&line, address - start)
    }

    /// Records a write of `bytes`, within one line, to `address`. A write loads no line.
    pub fn write(&mut self, address: usize, bytes: &[u8]) {
        let start = address & !(LINE - 1);
        if let Some((_, line)) = self.lines.iter_mut().find(|(at, _)| *at == start) {
            line.iter_mut().skip(address - start).zip(bytes).for_each(|(to, from)| *to = *from);
        }
    }

    /// Removes all lines, so that the next reads load them again.
    pub fn flush(&mut self) {
        self.lines.clear();
    }

    fn take(&mut self, start: usize) -> Option<[u8; LINE]> {
        let at = self.lines.iter().position(|(address, _)| *address == start)?;
        self.lines.remove(at).map(|(_, line)| line)
    }
}

/// `N` bytes from `start`. Bytes past the end are 0.
fn chunk<const N: usize>(bytes: &[u8], start: usize) -> [u8; N] {
    let mut chunk = [0; N];
    chunk.iter_mut().zip(bytes.iter().skip(start)).for_each(|(to, from)| *to = *from);
    chunk
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cached_line_shows_the_written_value_until_a_flush() {
        let mut cache = Cache::<16, 8>::new();
        let blank = [0xFF; 64];
        assert_eq!(cache.read(20, &blank), [0xFF; 4]);
        cache.write(20, &[1, 2, 3, 4]);
        assert_eq!(cache.read(20, &blank), [1, 2, 3, 4], "from the line: no cell has changed");
        cache.flush();
        assert_eq!(cache.read(20, &blank), [0xFF; 4]);
    }

    #[test]
    fn a_write_loads_no_line() {
        let mut cache = Cache::<16, 8>::new();
        cache.write(20, &[1, 2, 3, 4]);
        assert_eq!(cache.read(20, &[0xFF; 64]), [0xFF; 4]);
    }

    #[test]
    fn a_new_line_replaces_the_least_recently_used_one() {
        let mut cache = Cache::<16, 2>::new();
        let (old, new) = ([0; 64], [1; 64]);
        let _: [[u8; 1]; 4] = [0, 16, 0, 32].map(|at| cache.read(at, &old));
        assert_eq!(cache.read(0, &new), [0], "used again, so still cached");
        assert_eq!(cache.read(16, &new), [1], "replaced");
    }
}
