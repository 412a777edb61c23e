//! `cargo xtask bench`: how long the parse-and-answer path takes for a request, beside two Modbus RTU servers.
//!
//! All three get the same operations on the same register numbers with the same values, as one stream of
//! bytes in pieces of 64 that pay no heed to where frames end, and append their replies to one vector. Every
//! reply to undamaged traffic is held against what an independent model says, byte for byte; ours to damaged
//! traffic too. The rounds of the three are interleaved, each begins with a fresh server, and the median of
//! each is printed: so a busy machine disturbs all three alike.
//!
//! What is equal:
//! * the number of requests, of registers in each, their order and their values;
//! * finding frames in a stream, the check of CRC-16/MODBUS, registers looked up and bounds checked, the
//!   whole reply built with its CRC;
//! * a damaged request has one byte changed, and they are the same requests in all three streams.
//!
//! What is not, because the protocols differ:
//! * a Modbus register has two bytes, one of ours has one: their frames are longer (the table says by how
//!   much), and none of their values has to be checked against a range, as ours have;
//! * Modbus answers a write, this protocol does not;
//! * a Modbus frame has no header. On a line it is found by the silence round it; in a stream all a server
//!   can do is to go on with the next byte whenever a frame is refused, as both peers do here. Ours looks for
//!   its header, and keeps what it takes to tell what a silence would mean.
//!
//! Both peers get a buffer that moves its bytes as rarely as ours does.

use std::error::Error;
use std::time::{Duration, Instant};

mod server;
mod traffic;

use bench_servers::{ModbusCoreServer, OurServer, RmodbusServer};
use server::Serve;
use traffic::{CASES, Case, Protocol, Traffic};

/// Requests in one round.
const REQUESTS: usize = 2_000;
/// Rounds of each server and each case.
const ROUNDS: usize = 301;

/// One of those compared.
struct Contestant {
    name: &'static str,
    protocol: Protocol,
    start: fn() -> Box<dyn Serve>,
}

/// Ours, then the peers.
static CONTESTANTS: [Contestant; 3] = [
    Contestant {
        name: "protocol-core",
        protocol: Protocol::SevenBot,
        start: || Box::new(OurServer::default()),
    },
    Contestant {
        name: "modbus-core",
        protocol: Protocol::ModbusRtu,
        start: || Box::new(ModbusCoreServer::default()),
    },
    Contestant {
        name: "rmodbus",
        protocol: Protocol::ModbusRtu,
        start: || Box::new(RmodbusServer::default()),
    },
];

fn main() -> Result<(), Box<dyn Error>> {
    stay_on_one_core();
    println!("ns a request: median of {ROUNDS} rounds of {REQUESTS} requests");
    let names = CONTESTANTS.each_ref().map(|contestant| format!("{:>14}", contestant.name)).concat();
    println!("{:18}{names}{:>16}   bytes a request in + out", "", "ours / best");
    for case in CASES {
        let [ours, peers @ ..] = contest(case)?;
        print_row(case, &ours, &peers);
    }
    Ok(())
}

/// One contestant's part in one case.
struct Race {
    contestant: &'static Contestant,
    traffic: Traffic,
    times: Vec<Duration>,
    carried_out: usize,
}

impl Race {
    fn new(contestant: &'static Contestant, case: &Case) -> Self {
        let traffic = Traffic::new(case, contestant.protocol, REQUESTS);
        Self { contestant, traffic, times: Vec::with_capacity(ROUNDS), carried_out: 0 }
    }

    /// Runs one round and holds its replies against the model's.
    fn run(&mut self, replies: &mut Vec<u8>) -> Result<(), String> {
        replies.clear();
        let mut server = (self.contestant.start)();
        let start = Instant::now();
        server.serve(&self.traffic.requests, replies);
        self.times.push(start.elapsed());
        self.carried_out = server.carried_out();
        let all = self.carried_out == self.traffic.undamaged && *replies == self.traffic.replies;
        let is_ours = self.contestant.protocol == Protocol::SevenBot;
        if !all && (is_ours || self.traffic.undamaged == REQUESTS) {
            let Self { carried_out, traffic: Traffic { undamaged, .. }, .. } = self;
            let name = self.contestant.name;
            return Err(format!("{name} carried out {carried_out} of {undamaged}, or answered wrongly"));
        }
        Ok(())
    }

    /// The median of the rounds, in nanoseconds a request.
    fn nanoseconds(&self) -> f64 {
        let mut times = self.times.clone();
        times.sort_unstable();
        let median = times.get(times.len() / 2).copied().unwrap_or_default();
        median.as_secs_f64() * 1e9 / REQUESTS as f64
    }

    fn bytes_a_request(&self) -> String {
        let mean = |bytes: &[u8]| bytes.len() as f64 / REQUESTS as f64;
        format!("{:.0} + {:.0}", mean(&self.traffic.requests), mean(&self.traffic.replies))
    }

    /// How many of the undamaged requests were carried out, in percent.
    fn answered(&self) -> f64 {
        100.0 * self.carried_out as f64 / self.traffic.undamaged as f64
    }
}

/// Runs the rounds of one case.
fn contest(case: &Case) -> Result<[Race; 3], String> {
    let mut races = CONTESTANTS.each_ref().map(|contestant| Race::new(contestant, case));
    let mut replies = Vec::with_capacity(REQUESTS * 256);
    for _ in 0..ROUNDS {
        for race in &mut races {
            race.run(&mut replies).map_err(|why| format!("{}: {why}", case.name))?;
        }
    }
    Ok(races)
}

fn print_row(case: &Case, ours: &Race, peers: &[Race]) {
    let races = || std::iter::once(ours).chain(peers);
    let times: String = races().map(|race| format!("{:14.1}", race.nanoseconds())).collect();
    let best = peers.iter().map(Race::nanoseconds).fold(f64::INFINITY, f64::min);
    let bytes = peers.first().map_or_else(String::new, Race::bytes_a_request);
    let ratio = ours.nanoseconds() / best;
    println!("{:18}{times}{ratio:16.2}   ours {}, Modbus {bytes}", case.name, ours.bytes_a_request());
    if ours.traffic.undamaged < REQUESTS {
        let answered: String = races().map(|race| format!("{:12.2} %", race.answered())).collect();
        println!("{:18}{answered}   of the undamaged requests were carried out", "");
    }
}

/// Keeps the scheduler from moving this program about, where that can be had.
fn stay_on_one_core() {
    if let Some(core) = core_affinity::get_core_ids().and_then(|cores| cores.last().copied()) {
        core_affinity::set_for_current(core);
    }
}
