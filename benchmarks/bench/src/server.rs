//! Feeds a whole stream to a server.

use peers::Server;

/// Bytes taken from the line at once: the size of a driver's queue, independent of frames.
const PIECE: usize = 64;

/// Any server as a trait object. One dynamic call for a whole stream adds almost nothing to the time of a request.
pub(crate) trait Serve {
    /// Takes a whole stream and appends the replies.
    fn serve(&mut self, stream: &[u8], replies: &mut Vec<u8>);

    /// The number of requests executed so far.
    fn executed(&self) -> usize;
}

impl<S: Server> Serve for S {
    fn serve(&mut self, stream: &[u8], replies: &mut Vec<u8>) {
        let mut reply = |bytes: &[u8]| replies.extend_from_slice(bytes);
        for piece in stream.chunks(PIECE) {
            self.feed(piece, &mut reply);
        }
        self.end(&mut reply);
    }

    fn executed(&self) -> usize {
        Server::executed(self)
    }
}
