//! TCP ports that clients connect to.

use std::io;
use std::net::SocketAddr;
use std::time::Duration;

use socket2::{SockRef, TcpKeepalive};
use tokio::net::{TcpListener, TcpStream};

use super::start_error::StartError;

/// Bytes that the kernel keeps for a client that does not read; the kernel doubles the value. With the default of some
/// megabytes, a slow client would get old reports.
pub(super) const SEND_BUFFER: usize = 4_096;
/// Bytes that the kernel keeps of a client whose bytes have to wait; the kernel doubles the value.
const RECEIVE_BUFFER: usize = 4_096;
/// A peer that is silent for this long is asked whether it is still there.
const KEEPALIVE_IDLE: Duration = Duration::from_secs(10);
const KEEPALIVE_INTERVAL: Duration = Duration::from_secs(5);
const KEEPALIVE_PROBES: u32 = 3;
/// A peer that takes no byte for this long is gone. Other systems than Linux decide that by themselves.
#[cfg(target_os = "linux")]
const USER_TIMEOUT: Duration = Duration::from_secs(60);
/// Pause after a failed accept, for example because too many files are open.
pub(super) const AFTER_ERROR: Duration = Duration::from_millis(100);

pub(super) fn open_tcp(address: SocketAddr) -> Result<TcpListener, StartError> {
    let failed = |cause: io::Error| match cause.kind() {
        io::ErrorKind::AddrInUse => StartError::InUse(address),
        _ => StartError::Address { address, cause },
    };
    let listener = std::net::TcpListener::bind(address).map_err(failed)?;
    listener.set_nonblocking(true).map_err(failed)?;
    let _ = SockRef::from(&listener).set_recv_buffer_size(RECEIVE_BUFFER);
    TcpListener::from_std(listener).map_err(failed)
}

/// Accepts the next client. Its socket sends short frames at once, and fails when the computer of the client is gone.
pub(super) async fn accept_tcp(listener: &TcpListener) -> (TcpStream, SocketAddr) {
    loop {
        match listener.accept().await {
            Ok((stream, peer)) if set_options(&stream).is_ok() => return (stream, peer),
            Ok(_) => {}
            Err(_) => tokio::time::sleep(AFTER_ERROR).await,
        }
    }
}

fn set_options(stream: &TcpStream) -> io::Result<()> {
    stream.set_nodelay(true)?;
    let stream = SockRef::from(stream);
    stream.set_send_buffer_size(SEND_BUFFER)?;
    let keepalive = TcpKeepalive::new().with_time(KEEPALIVE_IDLE).with_interval(KEEPALIVE_INTERVAL);
    stream.set_tcp_keepalive(&keepalive.with_retries(KEEPALIVE_PROBES))?;
    #[cfg(target_os = "linux")]
    stream.set_tcp_user_timeout(Some(USER_TIMEOUT))?;
    Ok(())
}

#[cfg(test)]
#[allow(clippy::unwrap_used)] // A panic is a failed test.
mod tests {
    use super::*;

    #[test]
    fn a_peer_whose_computer_is_gone_is_noticed() {
        tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap().block_on(async {
            let listener = open_tcp(SocketAddr::from(([127, 0, 0, 1], 0))).unwrap();
            let _client = std::net::TcpStream::connect(listener.local_addr().unwrap()).unwrap();
            let (stream, _) = accept_tcp(&listener).await;
            assert!(stream.nodelay().unwrap());
            let stream = SockRef::from(&stream);
            assert!(stream.keepalive().unwrap());
            let silence = stream.tcp_keepalive_time().unwrap()
                + stream.tcp_keepalive_interval().unwrap() * stream.tcp_keepalive_retries().unwrap();
            assert_eq!(silence, Duration::from_secs(25), "the time in docs/serve.md");
            #[cfg(target_os = "linux")]
            assert_eq!(stream.tcp_user_timeout().unwrap(), Some(Duration::from_secs(60)));
        });
    }
}
