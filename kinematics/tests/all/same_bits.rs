//! Chip and host compute the same bits: `cargo xtask count` runs the same poses in the emulator.

#[path = "../../../benchmarks/footprint/src/poses.rs"]
mod poses;

#[test]
fn the_bits_are_those_of_the_chip() {
    assert_eq!(poses::poses().fold(0, poses::mix), poses::BITS);
}
