//! `cargo xtask bench`: how long the parse-and-answer path takes for a request, beside its peers: two Modbus RTU
//! servers, postcard with COBS, and MAVLink.
//!
//! All get the same operations on the same register numbers with the same values, as one stream of bytes in
//! pieces of 64 that pay no heed to where frames end, and append their replies to one vector. Every reply to
//! undamaged traffic is held against what an independent model says, byte for byte; ours to damaged traffic
//! too. The rounds are interleaved, each begins with a fresh server, and the median of each is printed: so a
//! busy machine disturbs all alike.
//!
//! What is equal:
//! * the number of requests, of registers in each, their order and their values;
//! * finding frames in a stream, a CRC-16 over each of them, registers looked up and bounds checked, the
//!   whole reply built with its CRC;
//! * a damaged request has one byte changed, and they are the same requests in all streams.
//!
//! What is not, because the protocols differ:
//! * a Modbus register has two bytes and a MAVLink frame says who speaks to whom, so their frames are longer
//!   (the table says by how much); postcard's requests are the shortest;
//! * none of the peers checks a value against the range of its register, holds access rights, or keeps what it
//!   takes to tell what a silence would mean (D4, D15, D16): ours does all of it;
//! * Modbus answers a write; the others do not;
//! * a frame ends where a zero comes (COBS), or is as long as its header says: there a wrong length can take
//!   whole frames with it. Modbus has no header either: on a line its frames are found by the silence round
//!   them; in a stream all a server can do is to go on with the next byte whenever a frame is refused.
//!
//! The peers get a buffer that moves its bytes as rarely as ours does.

use std::error::Error;
use std::time::{Duration, Instant};

mod protocol;
mod server;
mod traffic;

use bench_servers::{MavlinkServer, ModbusCoreServer, OurServer, PostcardServer, RmodbusServer};
use protocol::Protocol;
use server::Serve;
use traffic::{CASES, Case, Traffic};

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
static CONTESTANTS: [Contestant; 5] = [
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
    Contestant {
        name: "postcard+cobs",
        protocol: Protocol::Postcard,
        start: || Box::new(PostcardServer::default()),
    },
    Contestant { name: "mavlink", protocol: Protocol::Mavlink, start: || Box::new(MavlinkServer::default()) },
];

fn main() -> Result<(), Box<dyn Error>> {
    stay_on_one_core();
    println!(
        "Time of a request, median of {ROUNDS} interleaved rounds of {REQUESTS} requests; peers in multiples of ours"
    );
    let names = CONTESTANTS.each_ref().map(|contestant| format!("{:>14}", contestant.name)).concat();
    println!("{:20}{names}{:>13}", "", "ours / best");
    for case in CASES {
        print_row(case, &contest(case)?);
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

    /// How many of the undamaged requests were carried out.
    fn answered(&self) -> String {
        format!("{:.2} %", 100.0 * self.carried_out as f64 / self.traffic.undamaged as f64)
    }
}

/// Runs the rounds of one case.
fn contest(case: &Case) -> Result<[Race; CONTESTANTS.len()], String> {
    let mut races = CONTESTANTS.each_ref().map(|contestant| Race::new(contestant, case));
    let mut replies = Vec::with_capacity(REQUESTS * 256);
    for _ in 0..ROUNDS {
        for race in &mut races {
            race.run(&mut replies).map_err(|why| format!("{}: {why}", case.name))?;
        }
    }
    Ok(races)
}

/// Ours in nanoseconds a request, the peers as multiples of that, and ours as a part of the best peer's.
fn print_row(case: &Case, races: &[Race]) {
    let Some((ours, peers)) = races.split_first() else { return };
    let time = ours.nanoseconds();
    let multiples: String =
        peers.iter().map(|race| format!("{:12.2} x", race.nanoseconds() / time)).collect();
    let best = peers.iter().map(Race::nanoseconds).fold(f64::INFINITY, f64::min);
    println!("{:20}{time:11.1} ns{multiples}{:13.2}", case.name, time / best);
    print_cells("  bytes in + out", races, Race::bytes_a_request);
    if ours.traffic.undamaged < REQUESTS {
        print_cells("  undamaged, done", races, Race::answered);
    }
}

fn print_cells(title: &str, races: &[Race], cell: impl Fn(&Race) -> String) {
    let cells: String = races.iter().map(|race| format!("{:>14}", cell(race))).collect();
    println!("{title:20}{cells}");
}

/// Keeps the scheduler from moving this program about, where that can be had.
fn stay_on_one_core() {
    if let Some(core) = core_affinity::get_core_ids().and_then(|cores| cores.last().copied()) {
        core_affinity::set_for_current(core);
    }
}
