use std::vec::Vec;

use super::*;

fn at(millis: u64) -> Instant {
    Instant::ZERO + Duration::from_millis(millis)
}

/// Sends this many zeros through a line with a fault. Returns the bytes that arrive, and the count of the fault.
fn received(fault: LineFault, seed: u64, count: usize) -> (Vec<u8>, FaultCount) {
    let mut line = LineDirection::new(seed);
    line.set_fault(fault);
    let mut received = Vec::new();
    for _ in 0..count {
        assert_eq!(line.push(at(0), &[0]), 1);
        received.extend(line.arrived());
        line.take(1);
    }
    (received, line.fault_count(fault))
}

#[test]
fn each_fault_has_a_name() {
    for (word, fault) in [
        ("loss=1%", LineFault::Loss(10_000)),
        ("loss=0.5%", LineFault::Loss(5_000)),
        ("corruption=0.0001%", LineFault::Corruption(1)),
        ("corruption=100%", LineFault::Corruption(MILLION)),
        ("delay=20", LineFault::Delay(Duration::from_millis(20))),
    ] {
        assert_eq!(word.parse(), Ok(fault));
        assert_eq!(fault.to_string(), word);
    }
    assert_eq!("loss=2.25".parse(), Ok(LineFault::Loss(22_500)));
    for wrong in
        ["loss", "loss=", "loss=0", "loss=101", "loss=-1", "loss=1.23456", "delay=0", "delay=10001", "x=1"]
    {
        assert_eq!(wrong.parse::<LineFault>(), Err(UnknownLineFault), "{wrong}");
    }
}

#[test]
fn the_share_of_lost_bytes_is_as_set_and_the_seed_determines_them() {
    let (bytes, count) = received(LineFault::Loss(10_000), 7, 100_000);
    assert_eq!(count.occasions, 100_000);
    assert_eq!(100_000 - bytes.len() as u64, count.effects);
    assert!((900..1_100).contains(&count.effects), "{count:?}");
    assert_eq!(received(LineFault::Loss(10_000), 7, 100_000), (bytes, count));
    assert_ne!(received(LineFault::Loss(10_000), 8, 100_000).1, count);
}

#[test]
fn a_corrupt_byte_has_one_wrong_bit() {
    let (bytes, count) = received(LineFault::Corruption(MILLION), 1, 800);
    assert_eq!(count, FaultCount { effects: 800, occasions: 800 });
    assert!(bytes.iter().all(|byte| byte.count_ones() == 1));
    assert!((0..8).all(|bit| bytes.contains(&(1 << bit))), "each bit");
}

#[test]
fn a_delayed_byte_arrives_later_and_the_order_stays() {
    let mut line = LineDirection::new(1);
    line.set_fault(LineFault::Delay(Duration::from_millis(20)));
    line.push(at(0), b"ab");
    assert_eq!((line.deadline(), line.len(), line.is_in_transit()), (Some(at(20)), 2, true));
    line.advance(at(19));
    assert_eq!(line.arrived(), b"");
    line.end_fault(LineFault::Delay(Duration::from_millis(20)));
    line.push(at(19), b"c");
    line.advance(at(19));
    assert_eq!(line.arrived(), b"", "c waits for a and b");
    line.advance(at(20));
    assert_eq!(line.arrived(), b"abc");
    line.take(3);
    line.push(at(21), b"d");
    assert_eq!(line.arrived(), b"d");
}

#[test]
fn a_full_line_accepts_no_more_with_a_delay() {
    let mut line = LineDirection::new(1);
    line.set_fault(LineFault::Delay(Duration::from_millis(20)));
    assert_eq!(line.push(at(0), &[0; CAPACITY + 1]), CAPACITY);
    assert_eq!((line.room(), line.push(at(0), &[0])), (0, 0));
    line.clear(None);
    assert_eq!((line.room(), line.deadline()), (CAPACITY, None));
}
