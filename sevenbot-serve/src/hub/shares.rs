//! Fair use of the line: fair queueing by finish times, counted in bytes.
//!
//! Each client has a tag, a position on a line that is measured in bytes. A request moves its client's tag on by its length.
//! The request that would end at the lowest tag is next, so a short one goes before long ones from the same tag. A client that
//! was idle starts at the lowest tag of those that wait, unless its own is higher. So its next request waits for few frames,
//! however many frames the others have queued.

/// The tag of a client, and when it was served last.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Share {
    tag: u64,
    turn: u64,
}

impl Share {
    /// The share of a client that has sent nothing.
    pub(crate) const IDLE: Self = Self { tag: 0, turn: 0 };

    /// A client that was idle has a request again. `floor` comes from [`Shares::floor`].
    pub(crate) fn join(&mut self, floor: u64) {
        self.tag = self.tag.max(floor);
    }
}

/// The state that all clients share.
#[derive(Debug, Default)]
pub(crate) struct Shares {
    /// The highest tag of a request that was sent.
    current: u64,
    /// Number of requests sent.
    turns: u64,
}

impl Shares {
    /// The least tag of a client that was idle: the lowest tag of those that wait, or if none waits, the highest tag of a request
    /// that was sent. That one may be too high while others wait: a client with short requests can be ahead of them by the
    /// length of a long request.
    pub(crate) fn floor(&self, waiting: impl Iterator<Item = Share>) -> u64 {
        waiting.map(|share| share.tag).min().unwrap_or(self.current)
    }

    /// The sort key of a request of `bytes` bytes: the request with the smallest key is next. Of requests that would end at the
    /// same tag, that of the client which was served longest ago is next.
    pub(crate) fn order(share: Share, bytes: usize) -> (u64, u64) {
        (share.tag.saturating_add(length(bytes)), share.turn)
    }

    /// A request of this many bytes was sent.
    pub(crate) fn charge(&mut self, share: &mut Share, bytes: usize) {
        self.current = self.current.max(share.tag);
        self.turns += 1;
        share.turn = self.turns;
        share.tag = share.tag.saturating_add(length(bytes));
    }
}

fn length(bytes: usize) -> u64 {
    u64::try_from(bytes).unwrap_or(u64::from(u32::MAX))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Serves clients that always have a request of this many bytes, and counts the bytes of each.
    fn serve<const COUNT: usize>(lengths: [usize; COUNT], rounds: usize) -> [usize; COUNT] {
        let mut shares = Shares::default();
        let mut clients = [Share::default(); COUNT];
        let mut served = [0; COUNT];
        for _ in 0..rounds {
            let next =
                (0..COUNT).min_by_key(|&client| Shares::order(clients[client], lengths[client])).unwrap();
            shares.charge(&mut clients[next], lengths[next]);
            served[next] += lengths[next];
        }
        served
    }

    #[test]
    fn clients_get_equal_bytes_whatever_the_length_of_their_requests() {
        let served = serve([262, 14, 14], 10_000);
        let (least, most) = (served.iter().min().unwrap(), served.iter().max().unwrap());
        assert!(most - least <= 262, "{served:?}");
    }

    #[test]
    fn a_short_request_seldom_waits_for_a_round_of_long_ones() {
        let (mut shares, mut busy, mut one) = (Shares::default(), [Share::default(); 31], Share::default());
        let mut waits = Vec::new();
        let mut wait = 0;
        for turn in 0..10_000 {
            let next = (0..31).min_by_key(|&client| Shares::order(busy[client], 269)).unwrap();
            // The short client asks again while the reply to another client is on the line.
            if turn % 2 == 0 && Shares::order(one, 21) < Shares::order(busy[next], 269) {
                shares.charge(&mut one, 21);
                waits.push(wait);
                wait = 0;
            } else {
                shares.charge(&mut busy[next], 269);
                one.join(shares.floor(busy.iter().copied()));
                wait += 1;
            }
        }
        waits.sort_unstable();
        assert!(waits[waits.len() / 2] <= 3, "{waits:?}");
    }

    #[test]
    fn a_client_that_was_idle_is_next_also_beside_one_that_has_used_its_share() {
        let (mut shares, mut busy, mut chatty) =
            (Shares::default(), [Share::default(); 31], Share::default());
        shares.charge(&mut busy[0], 269);
        while Shares::order(chatty, 8) < Shares::order(busy[1], 269) {
            shares.charge(&mut chatty, 8);
        }
        let mut idle = Share::default();
        idle.join(shares.floor(busy.iter().copied().chain([chatty])));
        assert!(Shares::order(idle, 21) < Shares::order(busy[1], 269));
    }

    #[test]
    fn a_client_that_was_idle_is_next_but_does_not_catch_up() {
        let mut shares = Shares::default();
        let mut busy = [Share::default(); 9];
        let mut idle = Share::default();
        for turn in 0..900 {
            shares.charge(&mut busy[turn % 9], 262);
        }
        idle.join(shares.floor(busy.iter().copied()));
        assert!(busy.iter().all(|&share| Shares::order(idle, 14) < Shares::order(share, 262)));
        (0..40).for_each(|_| shares.charge(&mut idle, 14));
        assert!(
            busy.iter().any(|&share| Shares::order(share, 262) < Shares::order(idle, 14)),
            "the length of two frames, not of 100"
        );
    }
}
