//! Advice to the user after a failure, the most likely cause first. The list is empty if there is no advice.

use crate::error::{Error, OpenError, ReceiveCounts};
use crate::network::Address;

/// Advice after the port of this name, or the arm behind it, could not be opened.
#[must_use]
pub fn opening(port: &str, error: &OpenError) -> Vec<String> {
    let of_server = Address::parse(port).and_then(|address| connecting(&address, error));
    let lines: &[&str] = match (of_server, error) {
        (Some(lines), _) => lines,
        (None, OpenError::PermissionDenied { group }) => return vec![join(group.as_deref())],
        (None, OpenError::Silent(error)) => exchange(error),
        (None, OpenError::NotFound) if port.starts_with("sim:") => {
            &["a simulated arm is sim, or sim:SEED with a whole number, as sim:42"]
        }
        (None, OpenError::NotFound) => &[
            "is the arm plugged in, or the simulator started?",
            "a port may have a new name after it was plugged in again",
            "`sevenbot ports` lists the ports",
        ],
        (None, OpenError::Busy) => &[
            "if `sevenbot serve` holds the port, `sevenbot ports` shows the address to use instead",
            "otherwise close the other program: a terminal, a browser page, a second sevenbot",
            "on Linux, `fuser -v PORT` names it",
            "`sevenbot serve` shares an arm between programs: each of them connects to it",
        ],
        (None, OpenError::Unusable(_)) => {
            &["does this name belong to a serial port, and does it take this baud rate?"]
        }
        (None, OpenError::WrongDevice { .. }) => {
            &["is this the right port? `sevenbot ports` says which ones lead to arms"]
        }
    };
    lines.iter().map(|&line| line.to_owned()).collect()
}

/// Advice after a server could not be reached; `None` if the advice for a serial port fits.
fn connecting(address: &Address, error: &OpenError) -> Option<&'static [&'static str]> {
    match (error, address) {
        (OpenError::NotFound, Address::Name(_)) => Some(&[
            "`sevenbot ports --network` lists the names of servers",
            "where multicast is blocked: `sevenbot ports --remember NAME=tcp://HOST:PORT`",
        ]),
        (OpenError::Unusable(reason), _) if reason.to_lowercase().contains("certificate") => Some(&[
            "set SEVENBOT_CERTIFICATE to the PEM file of the server's certificate, which has to be for this host",
        ]),
        (OpenError::NotFound | OpenError::Unusable(_), Address::Unix(_)) => {
            Some(&["does `sevenbot serve` run? `sevenbot ports` shows its address"])
        }
        (OpenError::NotFound | OpenError::Unusable(_), _) => Some(&[
            "is the host right, and does `sevenbot serve` run there with this --tcp port?",
            "does a firewall block the port?",
        ]),
        (OpenError::Silent(Error::Port(_)), address) if address.takes_token() => Some(&[
            "the server closed the connection: is SEVENBOT_TOKEN set, and is it the token of the server?",
            "a server with too many clients closes it, too",
        ]),
        _ => None,
    }
}

fn join(group: Option<&str>) -> String {
    match group {
        Some("root") => "only root may open it, because of a udev rule or another kernel driver".to_owned(),
        Some(group) => {
            format!(
                "join the group that may open it: `sudo usermod -aG {group} $USER`, then log out and in again"
            )
        }
        None if cfg!(unix) => {
            "`ls -lL PORT` shows the owner and the group that may open it (often dialout or uucp); \
             join the group and log in again"
                .to_owned()
        }
        None => "is another program using it, or does it need an administrator?".to_owned(),
    }
}

/// Advice if frames arrive damaged, or if only other bytes arrive after earlier good frames. The baud rate is right, since
/// frames are recognized.
const NOISE: &[&str] = &[
    "frames arrive damaged: is every plug tight, and the ground of the computer and the arm common?",
    "lay the cable away from motors and their supply (interference), or use a shorter one",
    "does another program read from the same port? `sevenbot serve` shares the arm",
    "if the arm never answers again: switch it off and on",
];

/// Advice after an exchange with an arm failed.
#[must_use]
pub const fn exchange(error: &Error) -> &'static [&'static str] {
    match error {
        Error::OutsideMap { .. } => &[],
        Error::NoAnswer { received: ReceiveCounts { bytes: 0, .. }, .. } => &[
            "has the arm power, and is its cable plugged in at both ends?",
            "is this the right port? `sevenbot ports` says which ones lead to arms",
            "is the baud rate right (--baud)? `sevenbot --port PORT baud --find` tries all of them",
        ],
        Error::NoAnswer { received: ReceiveCounts { damaged_frames: 1.., .. }, .. }
        | Error::NoAnswer { received: ReceiveCounts { earlier_frames: 1.., other_frames: 0, .. }, .. } => {
            NOISE
        }
        Error::NoAnswer { received: ReceiveCounts { other_frames: 1.., .. }, .. } => &[
            "the arm sent frames, and then no answer: was it switched off, or has its controller stopped? Switch it off and on",
            "does another program use the same arm? `sevenbot serve` shares it",
        ],
        Error::NoAnswer { .. } => &[
            "bytes arrive, but no frames: probably the baud rate is wrong (--baud); \
             `sevenbot --port PORT baud --find` tries all rates",
            "is this the right port, and no other program reading from it?",
        ],
        Error::Port(_) => &["was the cable pulled, or has the simulator or the server ended?"],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::PortError;

    #[test]
    fn an_arm_that_fell_silent_is_not_taken_for_a_wrong_baud_rate() {
        let received =
            |bytes, other_frames| ReceiveCounts { bytes, other_frames, ..ReceiveCounts::default() };
        let advice = |received| {
            let (span, waited) = (host_link::Span::one(0), std::time::Duration::ZERO);
            exchange(&Error::NoAnswer { span, attempts: 1, waited, received }).concat()
        };
        assert!(advice(received(700, 50)).contains("has its controller stopped?"));
        assert!(advice(received(700, 0)).contains("the baud rate is wrong"));
        let damaged = ReceiveCounts { damaged_frames: 3, ..received(700, 50) };
        let after_good_frames = ReceiveCounts { earlier_frames: 9, ..received(12, 0) };
        for received in [damaged, after_good_frames] {
            assert!(
                advice(received).starts_with("frames arrive damaged: is every plug tight"),
                "{received:?}"
            );
        }
    }

    #[test]
    fn a_denied_permission_names_the_group_to_join() {
        let denied = OpenError::PermissionDenied { group: Some("dialout".to_owned()) };
        assert!(opening("/dev/ttyUSB0", &denied).concat().contains("usermod -aG dialout $USER"));
    }

    #[test]
    fn the_address_of_a_server_gets_no_advice_about_a_cable() {
        let lost = OpenError::from(PortError::Lost(std::io::ErrorKind::UnexpectedEof));
        let unusable = |reason: &str| OpenError::Unusable(reason.to_owned());
        for (port, error, says) in [
            ("tcp://10.0.0.5:7777", &lost, "SEVENBOT_TOKEN"),
            ("/dev/ttyUSB0", &lost, "was the cable pulled"),
            ("unix:/run/arm.sock", &lost, "was the cable pulled"),
            ("tcp://10.0.0.5:7777", &unusable("connection refused"), "--tcp port"),
            (
                "tls://10.0.0.5:7777",
                &unusable("invalid peer certificate: Expired"),
                "set SEVENBOT_CERTIFICATE",
            ),
            ("/dev/null", &unusable("not a typewriter"), "serial port"),
            ("sevenbot://lab-3", &OpenError::NotFound, "--remember"),
            ("unix:/run/arm.sock", &OpenError::NotFound, "does `sevenbot serve` run?"),
            ("sim:foo", &OpenError::NotFound, "with a whole number, as sim:42"),
        ] {
            let advice = opening(port, error).concat();
            assert!(advice.contains(says), "{port}: {advice}");
        }
    }
}
