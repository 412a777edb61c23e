//! A file of the true angles of the joints, for tests of a controller in another process. The measurements of that controller may
//! be old.
//!
//! Each line has the time in seconds since 1970, and seven angles in degrees. The next line follows after 10 ms at the earliest.

use std::fs::File;
use std::io::{self, Write};
use std::path::Path;
use std::time::{SystemTime, UNIX_EPOCH};

use arm_sim::plant::Plant;
use protocol_core::registers::Joint;
use protocol_core::time::{Duration, Instant};

/// Time between two lines, if the computer is fast enough.
const PERIOD: Duration = Duration::from_millis(10);

/// A file with the angles of the joints: at most one line each 10 ms.
#[derive(Debug)]
pub struct AngleLog {
    file: File,
    due: Instant,
}

impl AngleLog {
    /// Creates the file, or empties it.
    ///
    /// # Errors
    /// The file cannot be created.
    pub fn create(path: &Path) -> io::Result<Self> {
        Ok(Self { file: File::create(path)?, due: Instant::ZERO })
    }

    /// Writes a line if one is due. The plant must be simulated up to `now`.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write(&mut self, now: Instant, plant: &Plant) -> io::Result<()> {
        if now < self.due {
            return Ok(());
        }
        self.due = now + PERIOD;
        let time = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        let mut line = format!("{:.6}", time.as_secs_f64());
        for joint in Joint::ALL {
            line.push_str(&format!(",{:.3}", f64::from(plant.angle(joint)) / 1_000.0));
        }
        line.push('\n');
        self.file.write_all(line.as_bytes())
    }

    /// When the next line is due.
    #[must_use]
    pub const fn due(&self) -> Instant {
        self.due
    }
}
