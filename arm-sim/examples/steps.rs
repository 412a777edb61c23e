//! Steps of 20 ms of an arm whose joint 1 follows a sine, as in `python/benches/arms.py`. Each step sends a point of a stream and
//! reads positions, velocities, loads and blocked joints. `steps 500` makes 500 steps. With `steps 500 alone` the arm gets one
//! point a second and no read, which leaves the time of the simulation itself.
//!
//! ```text
//! valgrind --tool=callgrind target/release/examples/steps 500
//! ```

use std::env;
use std::error::Error;

use arm_sim::request::Request;
use arm_sim::{Duration, Simulation, SimulationConfig};
use protocol_core::registers::map::{BLOCKED_JOINTS, FINE_POSITION, FINE_TARGET, SET_POINT_PERIOD};

const STEP: Duration = Duration::from_millis(20);
/// Steps in a second.
const SECOND: u32 = 50;

fn main() -> Result<(), Box<dyn Error>> {
    let mut words = env::args().skip(1);
    let steps: u32 = words.next().ok_or("the number of steps")?.parse()?;
    let has_frames = words.next().is_none();
    let mut arm = Simulation::new(SimulationConfig { is_paced: false, ..SimulationConfig::default() });
    arm.advance(Duration::from_millis(1_000));
    let period: u16 = if has_frames { 20 } else { 1_000 };
    let values = period.to_le_bytes();
    arm.send_request(&Request::Write { address: SET_POINT_PERIOD.address, values: &values });
    let count = BLOCKED_JOINTS.address - FINE_POSITION.address + 1;
    let mut received = 0;
    for step in 0..steps {
        if has_frames || step % SECOND == 0 {
            let values = point(f64::from(step));
            arm.send_request(&Request::Write { address: FINE_TARGET.address, values: values.as_flattened() });
        }
        arm.advance(STEP);
        if has_frames {
            arm.send_request(&Request::Read { address: FINE_POSITION.address, count });
            received += arm.take_received().len();
        }
    }
    println!("{steps} steps, {received} bytes received");
    Ok(())
}

/// The angles of all joints in hundredths of a degree.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "70 to 110 degrees")]
fn point(step: f64) -> [[u8; 2]; 7] {
    let first = 9_000.0 + 2_000.0 * (step / 25.0).sin();
    [first as u16, 9_000, 6_500, 9_000, 9_000, 9_000, 8_000].map(u16::to_le_bytes)
}
