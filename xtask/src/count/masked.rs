//! How long interrupts are masked. Meanwhile no interrupt can take a byte from a line. At 1 Mbaud a byte lasts 1,680
//! cycles of the core.

use std::collections::HashMap;

use emulator::trace::TraceEvent;
use linked_image::Effect;

/// The most instructions between masking interrupts and unmasking them. Sleep ends a stretch, because an
/// interrupt ends sleep.
pub(super) fn longest_stretch(events: &[TraceEvent], effects: &HashMap<u64, Effect>) -> u64 {
    let (mut longest, mut stretch) = (0, None);
    for event in events {
        let TraceEvent::Step { at, .. } = event else { continue };
        match (effects.get(at), stretch) {
            (Some(Effect::EnableInterrupts), _) => stretch = None,
            (Some(Effect::WaitForInterrupt), Some(_)) => stretch = Some(0),
            (Some(Effect::DisableInterrupts), None) => stretch = Some(0),
            (_, Some(count)) => stretch = Some(count + 1),
            (_, None) => {}
        }
        longest = longest.max(stretch.unwrap_or(0));
    }
    longest
}

#[cfg(test)]
mod tests {
    use super::*;

    const MASK: u64 = 1;
    const UNMASK: u64 = 2;
    const SLEEP: u64 = 3;

    fn longest(steps: &[u64]) -> u64 {
        let effects = HashMap::from([
            (MASK, Effect::DisableInterrupts),
            (UNMASK, Effect::EnableInterrupts),
            (SLEEP, Effect::WaitForInterrupt),
        ]);
        let step = |&at: &u64| TraceEvent::Step { at, in_handler: false };
        let events: Vec<_> = steps.iter().map(step).chain([TraceEvent::Time(7)]).collect();
        longest_stretch(&events, &effects)
    }

    #[test]
    fn instructions_count_from_the_mask_to_its_end() {
        assert_eq!(longest(&[9, 9, 9]), 0, "nothing is masked");
        assert_eq!(longest(&[9, MASK, 9, 9, UNMASK, 9, 9, 9]), 2);
        assert_eq!(longest(&[MASK, 9, UNMASK, MASK, 9, 9, 9, UNMASK]), 3, "the longest of two");
    }

    #[test]
    fn a_mask_within_another_does_not_end_it() {
        assert_eq!(longest(&[MASK, 9, MASK, 9, UNMASK]), 3, "the second mask counts as an instruction");
    }

    #[test]
    fn sleep_ends_a_stretch() {
        assert_eq!(longest(&[MASK, 9, 9, SLEEP, 9, UNMASK]), 2);
    }
}
