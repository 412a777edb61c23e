//! The port by its file descriptor, whose readiness the system reports.

use std::io;
use std::path::Path;

use tty_ports::serial::Serial;

use crate::server::readiness::Readiness;

#[derive(Debug)]
pub(crate) struct ArmSerial {
    port: Serial,
    readiness: Readiness,
}

impl ArmSerial {
    pub(crate) fn open(path: &Path, baud: u32) -> io::Result<Self> {
        let port = Serial::open(path, baud).map_err(io::Error::other)?;
        let readiness = Readiness::of(&port)?;
        Ok(Self { port, readiness })
    }

    /// Reads bytes that have arrived. If it returns fewer than asked for, no more have arrived.
    pub(crate) fn read(&self, bytes: &mut [u8]) -> io::Result<usize> {
        self.port.read(bytes)
    }

    /// Sends bytes. Returns how many were accepted.
    pub(crate) fn write(&self, bytes: &[u8]) -> io::Result<usize> {
        self.port.write(bytes)
    }

    /// Ends when there is something to read, or an error.
    pub(crate) async fn readable(&self) -> io::Result<()> {
        self.readiness.readable().await
    }

    /// Ends when the port takes bytes.
    pub(crate) async fn writable(&self) -> io::Result<()> {
        self.readiness.writable().await
    }
}
