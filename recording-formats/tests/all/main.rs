//! Recordings in all formats, and files that are cut off or damaged.

#![allow(clippy::expect_used, clippy::indexing_slicing, clippy::panic, clippy::unwrap_used)] // A panic is a failed test.

mod damage;
mod messages;
mod round_trip;

use std::time::Duration;

use recording_formats::{McapLayout, McapWriter, Telemetry};
use sevenbot::FineAngle;
use sevenbot::recording::{Moment, Recording};

/// The time since 1970 at which the recordings of the tests begin.
const START: Duration = Duration::from_secs(1_700_000_000);

/// This many moments of random angles, 20 ms apart.
fn recording(count: u32) -> Recording {
    let mut random = fastrand::Rng::with_seed(u64::from(count));
    let moments = (0..count).map(|number| Moment {
        time: Duration::from_millis(20) * number,
        pose: [(); 7].map(|()| {
            FineAngle::from_hundredths(random.u16(0..=FineAngle::MAX_HUNDREDTHS)).expect("an angle")
        }),
        vacuum: number % 40 > 20,
    });
    Recording::of_moments(moments).expect("a recording")
}

/// The recording as an MCAP file. If its end is cut off, it is what a killed program leaves.
fn mcap_bytes(recording: &Recording, layout: McapLayout) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut writer = McapWriter::new(&mut bytes, layout).expect("a file");
    for moment in recording.moments() {
        writer.add(START + moment.time, &moment, &Telemetry::default()).expect("memory");
    }
    writer.finish().expect("memory");
    assert_eq!(writer.written(), recording.moments().count() as u64);
    drop(writer);
    bytes
}
