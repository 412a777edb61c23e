//! Counts the instructions of one server: three requests, each passed whole and then byte by byte.

use peers::Server;
use peers::work::Requests;

use crate::meter::Meter;
use crate::opaque;

/// The main function of a program that counts the instructions of one server.
#[macro_export]
macro_rules! count_program {
    ($server:ty, $requests:expr) => {
        #[cortex_m_rt::entry]
        fn main() -> ! {
            $crate::count_server::run::<$server>($requests)
        }
    };
}

/// Counts the instructions of each request, prints them, and never returns.
pub fn run<S: Server + Default>(requests: Requests) -> ! {
    let meter = Meter::default();
    let mut server = opaque(S::default());
    whole(&meter, &mut server, "read of 7, fed whole", requests.read_of_7);
    whole(&meter, &mut server, "write of 7, fed whole", requests.write_of_7);
    whole(&meter, &mut server, "read of 61, fed whole", requests.read_of_61);
    by_byte(&meter, &mut server, "read of 7, byte by byte", requests.read_of_7);
    by_byte(&meter, &mut server, "write of 7, byte by byte", requests.write_of_7);
    by_byte(&meter, &mut server, "read of 61, byte by byte", requests.read_of_61);
    meter.print("requests carried out", u32::try_from(server.executed()).unwrap_or(0));
    meter.print("state with all registers, bytes", u32::try_from(size_of::<S>()).unwrap_or(0));
    meter.end()
}

fn whole(meter: &Meter, server: &mut impl Server, name: &str, request: &[u8]) {
    let request = opaque(request);
    meter.print(name, meter.count(|| feed(server, request)));
}

fn by_byte(meter: &Meter, server: &mut impl Server, name: &str, request: &[u8]) {
    let request = opaque(request);
    meter.print(name, meter.count(|| request.chunks(1).for_each(|byte| feed(server, byte))));
}

/// The counted call. `cargo xtask bench` and `cargo xtask size` find its stack use by this function's name.
#[inline(never)]
fn feed(server: &mut impl Server, piece: &[u8]) {
    server.feed(piece, &mut |reply| {
        opaque(reply);
    });
}
