//! `cargo xtask bench`: the time per request of the parse-and-reply path, and of four peers: two Modbus RTU servers, postcard
//! with COBS, and MAVLink.
//!
//! All servers get the same operations, as one stream in pieces of 64 bytes, without regard to frame boundaries.
//! They append their replies to one vector. Each reply to undamaged traffic is compared, byte by byte, with an
//! independent model. Our replies to damaged traffic are compared too. The rounds of the servers are interleaved, so
//! that other load on the machine affects all alike. Each round begins with a fresh server, and the median of the
//! rounds is printed.
//!
//! The rule of the comparison is equal payload bytes:
//! * A read of 7 returns the same 7 bytes in every protocol, and a write of 7 stores the same 7 bytes.
//! * A Modbus register holds two bytes, so Modbus reads and writes whole registers: 4 registers (8 bytes) instead of 7 bytes,
//!   and 31 registers (62 bytes) instead of 61. The rounding costs the Modbus servers one byte in each operation.
//!
//! All servers do this work:
//! * find the frames in the stream, and check a CRC-16 over each;
//! * check that the bytes exist, and read or write them;
//! * build the whole reply to a read, with its CRC.
//!
//! These differences come from the protocols:
//! * Our server also checks each written value against its range, checks access rights, and keeps the state for its
//!   timeouts (D4, D15, D16). No peer does.
//! * A Modbus server replies to a write; the others do not.
//! * Frames differ in length (the table prints it): MAVLink names sender and receiver.
//! * COBS finds a frame by a zero, so a damaged zero can hide the frame that follows. MAVLink finds a frame by its header. On a
//!   line, silence separates Modbus frames. In a stream, a Modbus or MAVLink server skips one byte when a frame is invalid.
//!
//! The peers get a receive buffer that moves its bytes as rarely as ours.

use std::error::Error;
use std::time::{Duration, Instant};

mod operation;
mod protocol;
mod request_stream;
mod server;

use peers::{MavlinkServer, ModbusCoreServer, OurServer, PostcardServer, RmodbusServer};
use protocol::Protocol;
use request_stream::{CASES, Case, RequestStream};
use server::Serve;

/// Requests in a round.
const REQUESTS: usize = 2_000;
/// Rounds of each server and each case.
const ROUNDS: usize = 301;

struct MeasuredServer {
    name: &'static str,
    protocol: Protocol,
    start: fn() -> Box<dyn Serve>,
}

/// Our server, then the peers.
static SERVERS: [MeasuredServer; 5] = [
    MeasuredServer {
        name: "protocol-core",
        protocol: Protocol::SevenBot,
        start: || Box::new(OurServer::default()),
    },
    MeasuredServer {
        name: "modbus-core",
        protocol: Protocol::ModbusRtu,
        start: || Box::new(ModbusCoreServer::default()),
    },
    MeasuredServer {
        name: "rmodbus",
        protocol: Protocol::ModbusRtu,
        start: || Box::new(RmodbusServer::default()),
    },
    MeasuredServer {
        name: "postcard+cobs",
        protocol: Protocol::Postcard,
        start: || Box::new(PostcardServer::default()),
    },
    MeasuredServer {
        name: "mavlink",
        protocol: Protocol::Mavlink,
        start: || Box::new(MavlinkServer::default()),
    },
];

fn main() -> Result<(), Box<dyn Error>> {
    pin_to_core();
    println!(
        "Time of a request, median of {ROUNDS} interleaved rounds of {REQUESTS} requests; peers in multiples of ours"
    );
    let names = SERVERS.each_ref().map(|server| format!("{:>14}", server.name)).concat();
    println!("{:20}{names}{:>13}", "", "ours / best");
    for case in CASES {
        print_row(case, &measure(case)?);
    }
    Ok(())
}

/// The rounds of one server in one case.
struct Measurement {
    server: &'static MeasuredServer,
    stream: RequestStream,
    times: Vec<Duration>,
    executed: usize,
}

impl Measurement {
    fn new(server: &'static MeasuredServer, case: &Case) -> Self {
        let stream = RequestStream::new(case, server.protocol, REQUESTS);
        Self { server, stream, times: Vec::with_capacity(ROUNDS), executed: 0 }
    }

    /// Runs one round and compares its replies with the model's.
    fn run(&mut self, replies: &mut Vec<u8>) -> Result<(), String> {
        replies.clear();
        let mut server = (self.server.start)();
        let start = Instant::now();
        server.serve(&self.stream.requests, replies);
        self.times.push(start.elapsed());
        self.executed = server.executed();
        let all = self.executed == self.stream.undamaged && *replies == self.stream.replies;
        let is_ours = self.server.protocol == Protocol::SevenBot;
        if !all && (is_ours || self.stream.undamaged == REQUESTS) {
            let Self { executed, stream: RequestStream { undamaged, .. }, .. } = self;
            let name = self.server.name;
            return Err(format!("{name} executed {executed} of {undamaged} requests, or sent a wrong reply"));
        }
        Ok(())
    }

    /// The median of the rounds, in nanoseconds per request.
    fn nanoseconds(&self) -> f64 {
        let mut times = self.times.clone();
        times.sort_unstable();
        let median = times.get(times.len() / 2).copied().unwrap_or_default();
        median.as_secs_f64() * 1e9 / REQUESTS as f64
    }

    fn bytes_per_request(&self) -> String {
        let mean = |bytes: &[u8]| bytes.len() as f64 / REQUESTS as f64;
        format!("{:.0} + {:.0}", mean(&self.stream.requests), mean(&self.stream.replies))
    }

    /// The share of the undamaged requests that was executed.
    fn share_executed(&self) -> String {
        format!("{:.2} %", 100.0 * self.executed as f64 / self.stream.undamaged as f64)
    }
}

/// Runs the rounds of one case.
fn measure(case: &Case) -> Result<[Measurement; SERVERS.len()], String> {
    let mut measurements = SERVERS.each_ref().map(|server| Measurement::new(server, case));
    let mut replies = Vec::with_capacity(REQUESTS * 256);
    for _ in 0..ROUNDS {
        for measurement in &mut measurements {
            measurement.run(&mut replies).map_err(|why| format!("{}: {why}", case.name))?;
        }
    }
    Ok(measurements)
}

/// Prints our time of a request, the peers' as multiples of it, and our time divided by the best peer's.
fn print_row(case: &Case, measurements: &[Measurement]) {
    let Some((ours, peers)) = measurements.split_first() else { return };
    let time = ours.nanoseconds();
    let multiples: String =
        peers.iter().map(|measurement| format!("{:12.2} x", measurement.nanoseconds() / time)).collect();
    let best = peers.iter().map(Measurement::nanoseconds).fold(f64::INFINITY, f64::min);
    println!("{:20}{time:11.1} ns{multiples}{:13.2}", case.name, time / best);
    print_cells("  bytes in + out", measurements, Measurement::bytes_per_request);
    if ours.stream.undamaged < REQUESTS {
        print_cells("  undamaged, done", measurements, Measurement::share_executed);
    }
}

fn print_cells(title: &str, measurements: &[Measurement], cell: impl Fn(&Measurement) -> String) {
    let cells: String = measurements.iter().map(|measurement| format!("{:>14}", cell(measurement))).collect();
    println!("{title:20}{cells}");
}

/// Pins this program to one core, where the system supports it.
fn pin_to_core() {
    if let Some(core) = core_affinity::get_core_ids().and_then(|cores| cores.last().copied()) {
        core_affinity::set_for_current(core);
    }
}
