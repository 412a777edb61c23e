//! A server of any kind, fed a whole stream.

use bench_servers::Server;

/// Bytes taken from the line at once: a driver's queue, not a frame.
const PIECE: usize = 64;

/// A server, whichever. One call through the trait object a stream, so that none is counted.
pub(crate) trait Serve {
    /// Takes a whole stream and appends the replies.
    fn serve(&mut self, stream: &[u8], replies: &mut Vec<u8>);

    /// How many requests were carried out so far.
    fn carried_out(&self) -> usize;
}

impl<S: Server> Serve for S {
    fn serve(&mut self, stream: &[u8], replies: &mut Vec<u8>) {
        let mut reply = |bytes: &[u8]| replies.extend_from_slice(bytes);
        for piece in stream.chunks(PIECE) {
            self.feed(piece, &mut reply);
        }
        self.end(&mut reply);
    }

    fn carried_out(&self) -> usize {
        Server::carried_out(self)
    }
}
