//! What the comparison asks of a server.

/// Bytes taken from the line at once: a driver's queue, not a frame.
const PIECE: usize = 64;

/// Takes a stream of requests and answers it.
pub(crate) trait Server {
    /// Takes the next piece of the stream and appends the replies that follow from it.
    fn feed(&mut self, piece: &[u8], replies: &mut Vec<u8>);

    /// The line has been silent for long: whatever is still unfinished stays so.
    fn end(&mut self, replies: &mut Vec<u8>);

    /// How many requests were carried out so far.
    fn carried_out(&self) -> usize;

    /// Takes a whole stream. One call through the trait object a stream, so that none is counted.
    fn serve(&mut self, stream: &[u8], replies: &mut Vec<u8>) {
        for piece in stream.chunks(PIECE) {
            self.feed(piece, replies);
        }
        self.end(replies);
    }
}
