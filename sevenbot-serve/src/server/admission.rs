//! Places limit the number of connections: some are for connections that have not shown their token yet, others for clients.
//!
//! If all places for connections without a token are taken, the oldest of these connections loses its place to the next one. So
//! connections that send nothing do not keep out a client that sends its token at once. After wrong tokens, the next tokens
//! from the same address are checked one after the other, each after a delay. The number of all connections is bounded, too,
//! because each takes file descriptors.

use std::collections::{BTreeMap, VecDeque};
use std::net::IpAddr;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use tokio::sync::{Notify, OwnedSemaphorePermit, Semaphore};

use super::shared::lock;

/// Connections beyond the places: each of the TCP listeners may hold one that it is about to refuse.
const WAYS_IN: usize = 3;
/// The first wait after a wrong token; each further one doubles it.
const FIRST_WAIT: Duration = Duration::from_millis(100);
const LONGEST_WAIT: Duration = Duration::from_secs(2);
/// Connections of one address that may wait for the check of their tokens. More are refused.
const MOST_WAITING: u32 = 16;
/// Addresses with wrong tokens that are remembered.
const MOST_ADDRESSES: usize = 256;

/// A place of a client, or of any connection.
pub(super) type Place = OwnedSemaphorePermit;

#[derive(Clone, Copy, Debug)]
pub(super) struct Places {
    pub(super) clients: usize,
    /// For clients that the others must not keep out.
    pub(super) reserved: usize,
    /// For connections that have not shown a token, or get a file.
    pub(super) unknown: usize,
}

impl Places {
    pub(super) const fn sum(self) -> usize {
        self.clients + self.reserved + self.unknown
    }
}

/// The places of the connections, and the wrong tokens of each address.
#[derive(Debug)]
pub(super) struct ConnectionAdmission {
    connections: Arc<Semaphore>,
    clients: Arc<Semaphore>,
    reserved: Arc<Semaphore>,
    unknown: Mutex<VecDeque<Arc<Notify>>>,
    most_unknown: usize,
    wrong: Mutex<BTreeMap<IpAddr, WrongTokens>>,
}

#[derive(Clone, Copy, Debug)]
struct WrongTokens {
    count: u32,
    /// The next token from this address is not checked before this time.
    next: Instant,
    /// Connections that wait for the check of their tokens.
    waiting: u32,
}

impl WrongTokens {
    fn wait(self) -> Duration {
        FIRST_WAIT.saturating_mul(1 << self.count.saturating_sub(1).min(10)).min(LONGEST_WAIT)
    }
}

/// Too many connections of an address wait for the check of their tokens.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct TooManyWait;

/// A connection that waits for the check of its token, until it is dropped.
struct Turn<'a> {
    admission: &'a ConnectionAdmission,
    address: IpAddr,
}

impl Drop for Turn<'_> {
    fn drop(&mut self) {
        if let Some(wrong) = lock(&self.admission.wrong).get_mut(&self.address) {
            wrong.waiting = wrong.waiting.saturating_sub(1);
        }
    }
}

impl ConnectionAdmission {
    /// Places for so many clients, and for as many connections that have not shown their token: all programs of a server may come
    /// back at once.
    pub(super) fn new(most: usize) -> Arc<Self> {
        Self::with(Places { clients: most, reserved: 0, unknown: most })
    }

    pub(super) fn with(places: Places) -> Arc<Self> {
        let Places { clients, reserved, unknown: most_unknown } = places;
        Arc::new(Self {
            connections: Arc::new(Semaphore::new(places.sum() + WAYS_IN)),
            clients: Arc::new(Semaphore::new(clients)),
            reserved: Arc::new(Semaphore::new(reserved)),
            unknown: Mutex::default(),
            most_unknown,
            wrong: Mutex::default(),
        })
    }

    /// Waits until another connection may be accepted.
    pub(super) async fn connection(&self) -> Option<Place> {
        Arc::clone(&self.connections).acquire_owned().await.ok()
    }

    /// Runs the login of a connection. `None` if the login fails or does not end within `timeout`, or if the connection
    /// loses its place.
    pub(super) async fn log_in<T>(
        &self,
        timeout: Duration,
        login: impl Future<Output = Option<T>>,
    ) -> Option<T> {
        let ticket = Arc::new(Notify::new());
        {
            let mut unknown = lock(&self.unknown);
            unknown.push_back(Arc::clone(&ticket));
            if unknown.len() > self.most_unknown
                && let Some(oldest) = unknown.pop_front()
            {
                oldest.notify_one();
            }
        }
        let done = tokio::select! {
            done = login => done,
            () = ticket.notified() => None,
            () = tokio::time::sleep(timeout) => None,
        };
        lock(&self.unknown).retain(|other| !Arc::ptr_eq(other, &ticket));
        done
    }

    /// A place for a client; `None` if all are taken.
    pub(super) fn place(&self) -> Option<Place> {
        Arc::clone(&self.clients).try_acquire_owned().ok()
    }

    /// A reserved place; `None` if all are taken.
    pub(super) fn reserved_place(&self) -> Option<Place> {
        Arc::clone(&self.reserved).try_acquire_owned().ok()
    }

    /// Waits for the delay that wrong tokens of this address cause. The caller then checks its token, and calls [`Self::note`].
    pub(super) async fn wait(&self, address: Option<IpAddr>) -> Result<(), TooManyWait> {
        let Some(address) = address else { return Ok(()) };
        let turn = {
            let mut wrong = lock(&self.wrong);
            let Some(wrong) = wrong.get_mut(&address) else { return Ok(()) };
            if wrong.waiting >= MOST_WAITING {
                return Err(TooManyWait);
            }
            wrong.waiting += 1;
            Turn { admission: self, address }
        };
        while let Some(next) = self.take_turn(address) {
            tokio::time::sleep_until(next.into()).await;
        }
        drop(turn);
        Ok(())
    }

    /// Takes the next check of a token of this address for the caller, and returns `None`. If the delay is not over yet, or
    /// another connection took the check, returns when to try again.
    fn take_turn(&self, address: IpAddr) -> Option<Instant> {
        let mut wrong = lock(&self.wrong);
        let wrong = wrong.get_mut(&address)?;
        let now = Instant::now();
        if now < wrong.next {
            return Some(wrong.next);
        }
        wrong.next = now + wrong.wait();
        None
    }

    /// Notes whether the token of this address was right.
    pub(super) fn note(&self, address: Option<IpAddr>, is_right: bool) {
        let Some(address) = address else { return };
        let mut wrong = lock(&self.wrong);
        if is_right {
            wrong.remove(&address);
            return;
        }
        if wrong.len() >= MOST_ADDRESSES && !wrong.contains_key(&address) {
            wrong.clear();
        }
        let now = Instant::now();
        let entry = wrong.entry(address).or_insert(WrongTokens { count: 0, next: now, waiting: 0 });
        entry.count = entry.count.saturating_add(1);
        entry.next = now + entry.wait();
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)] // A panic is a failed test.
mod tests {
    use super::*;
    use std::future::{pending, ready};

    fn run<T>(work: impl Future<Output = T>) -> T {
        tokio::runtime::Builder::new_current_thread().enable_time().build().unwrap().block_on(work)
    }

    const MOST: usize = 64;
    const LONG: Duration = Duration::from_secs(600);

    #[test]
    fn silent_connections_lose_their_places_to_the_next_ones() {
        run(async {
            let admission = ConnectionAdmission::new(MOST);
            let silent: Vec<_> = (0..MOST + 24)
                .map(|_| {
                    let admission = Arc::clone(&admission);
                    tokio::spawn(async move { admission.log_in(LONG, pending::<Option<()>>()).await })
                })
                .collect();
            while lock(&admission.unknown).len() < MOST {
                tokio::task::yield_now().await;
            }
            // The last ones have to be there, too.
            tokio::task::yield_now().await;
            assert_eq!(admission.log_in(LONG, ready(Some(7))).await, Some(7));
            let mut ended = silent.iter().filter(|task| task.is_finished()).count();
            while ended < 25 {
                tokio::task::yield_now().await;
                ended = silent.iter().filter(|task| task.is_finished()).count();
            }
            assert_eq!(lock(&admission.unknown).len(), MOST - 1);
        });
    }

    /// The largest number of wrong tokens that may have been checked `elapsed` after the first one: the next ones follow it
    /// by 0.1, 0.3 and 0.7 s.
    fn most_checks(elapsed: Duration) -> u32 {
        let (mut count, mut wait, mut next) = (1, FIRST_WAIT, FIRST_WAIT);
        while next <= elapsed {
            wait = wait.saturating_mul(2).min(LONGEST_WAIT);
            next += wait;
            count += 1;
        }
        count
    }

    /// 200 connections with wrong tokens come at once.
    #[test]
    fn wrong_tokens_of_one_address_are_checked_one_after_the_other() {
        run(async {
            let admission = ConnectionAdmission::new(MOST);
            let address: IpAddr = "10.0.0.1".parse().unwrap();
            admission.note(Some(address), false);
            let start = Instant::now();
            let guesses: Vec<_> = (0..200)
                .map(|_| {
                    let admission = Arc::clone(&admission);
                    tokio::spawn(async move {
                        let turn = admission.wait(Some(address)).await;
                        turn.inspect(|()| admission.note(Some(address), false)).is_ok()
                    })
                })
                .collect();
            tokio::time::sleep(Duration::from_millis(650)).await;
            let refused = guesses.iter().filter(|guess| guess.is_finished()).count();
            let checked = lock(&admission.wrong).get(&address).unwrap().count;
            // At most 3 until 0.7 s have passed. A busy machine may get here later.
            let most = most_checks(start.elapsed());
            assert!(checked <= most, "{checked} in {:?}", start.elapsed());
            let most = usize::try_from(most).unwrap();
            assert!((184..=184 + most).contains(&refused), "{refused}: the others wait");
            assert_eq!(admission.wait(Some("10.0.0.2".parse().unwrap())).await, Ok(()), "another address");
            guesses.iter().for_each(tokio::task::JoinHandle::abort);
            while lock(&admission.wrong).get(&address).unwrap().waiting > 0 {
                tokio::task::yield_now().await;
            }
            admission.note(Some(address), true);
            assert_eq!(admission.wait(Some(address)).await, Ok(()));
        });
    }

    #[test]
    fn each_wrong_token_makes_the_next_one_of_the_address_wait_longer() {
        let admission = ConnectionAdmission::new(MOST);
        let address: IpAddr = "10.0.0.1".parse().unwrap();
        let start = Instant::now();
        (0..6).for_each(|_| admission.note(Some(address), false));
        let next = lock(&admission.wrong).get(&address).unwrap().next;
        assert!(next - start >= Duration::from_secs(2), "{:?}", next - start);
        admission.note(Some(address), true);
        assert!(lock(&admission.wrong).is_empty());
        (0..1_000_u32).for_each(|number| admission.note(Some(IpAddr::V4(number.into())), false));
        assert!(lock(&admission.wrong).len() <= MOST_ADDRESSES);
    }
}
