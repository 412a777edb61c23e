//! Finds settings that the arm holds but may not have stored.

use protocol_core::registers::map::fault;

use super::cause::MismatchCause;
use super::mismatch::WriteMismatch;
use crate::status_block::StatusBlock;
use crate::table::settings;

/// The settings among these writes, if the fault bit of the settings storage is set. Their registers hold the values. The
/// bit is also set when the storage becomes full, even if it stored these settings as the last ones.
pub(super) fn not_stored(writes: &[(u8, Vec<u8>)], after: Option<&StatusBlock>) -> Vec<WriteMismatch> {
    if after.is_none_or(|status| status.faults() & fault::SETTINGS_STORAGE == 0) {
        return Vec::new();
    }
    let values = writes.iter().flat_map(|(first, values)| (*first..=u8::MAX).zip(values));
    values
        .filter(|(address, _)| settings().any(|row| row.holds(*address)))
        .map(|(address, &value)| {
            let (wanted, cause) = (value.into(), MismatchCause::NotStored);
            WriteMismatch { address, wanted, found: wanted, cause }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use crate::simulated::{self, SimulationConfig};
    use protocol_core::registers::map::OFFSET;

    #[test]
    fn a_setting_that_is_not_stored_is_an_error() {
        let (mut arm, simulation) = simulated::arm(SimulationConfig::default()).expect("an arm");
        let mut set = |degrees: u8| {
            let done = arm.with_open_lock(|arm| arm.write_checked(OFFSET.address, &[degrees; 2]));
            done.map_err(|error| error.to_string())
        };
        assert_eq!(set(1), Ok(()));
        simulation.with(|arm| arm.set_fault("flash=fails".parse().expect("a fault"), None));
        for attempt in ["changes the value", "writes the same again"] {
            let error = set(2).expect_err(attempt);
            assert!(error.starts_with("offset.1 to offset.2 may be lost when the arm is switched off: the"));
        }
        simulation.with(|arm| drop(arm.end_faults(None)));
        assert_eq!(set(3), Ok(()));
        simulation.with(|arm| arm.restart_controller());
        assert_eq!(arm.read(OFFSET.address, 2), Ok(vec![3, 3]));
    }
}
