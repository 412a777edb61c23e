//! Runs the host library on any bytes from the arm, and checks frames, snapshots and register names. Also parses any text as a
//! register name.

use arbitrary::Arbitrary;
use protocol_core::registers::map21::find_readable;
use protocol_core::request::Reply;
use protocol_core::time::{Duration, Instant};
use protocol_core::wire::{Deframer, FrameBuffer, ToHost};
use sevenbot::{Snapshot, names, register_text};

/// The input of a run: bytes from the arm, the size of the pieces in which they arrive, and a text that names a register.
#[derive(Arbitrary, Debug)]
pub struct Input<'a> {
    piece: u8,
    sent: Vec<SentBytes<'a>>,
    text: &'a str,
}

#[derive(Arbitrary, Debug)]
enum SentBytes<'a> {
    Bytes(&'a [u8]),
    /// A reply, perhaps truncated or corrupted.
    Reply {
        address: u8,
        values: &'a [u8],
        missing: u8,
        damage: Option<(u8, u8)>,
    },
}

impl SentBytes<'_> {
    fn bytes(&self) -> Vec<u8> {
        let (address, values, missing, damage) = match *self {
            Self::Bytes(bytes) => return bytes.to_vec(),
            Self::Reply { address, values, missing, damage } => (address, values, missing, damage),
        };
        let mut frame = FrameBuffer::new();
        Reply { address, values }.encode(&mut frame);
        frame.truncate(frame.len().saturating_sub(missing.into()));
        if let Some((place, change)) = damage
            && let Some(byte) = frame.get_mut(usize::from(place))
        {
            *byte ^= change;
        }
        frame.to_vec()
    }
}

/// Runs the library. Panics if an invariant is violated.
pub fn run(input: &Input<'_>) {
    let Input { piece, sent, text } = input;
    let bytes: Vec<u8> = sent.iter().flat_map(SentBytes::bytes).collect();
    let in_pieces = snapshots(&bytes, usize::from(*piece).max(1));
    assert_eq!(in_pieces, snapshots(&bytes, bytes.len().max(1)), "the size of the pieces has no effect");
    in_pieces.iter().for_each(check);
    if let Ok(span) = names::parse(text) {
        assert!(usize::from(span.address()) + usize::from(span.count()) <= 256, "{text}: {span}");
    }
}

fn snapshots(bytes: &[u8], piece: usize) -> Vec<Snapshot> {
    let mut deframer = Deframer::<ToHost>::new(Duration::from_millis(2));
    let mut snapshots = Vec::new();
    for part in bytes.chunks(piece) {
        let mut rest = part;
        while !rest.is_empty() {
            let taken = deframer.push(Instant::ZERO, rest);
            rest = &rest[taken..];
            pull(&mut deframer, &mut snapshots);
        }
    }
    // Pass the gap, then the timeout of a frame (D4), so that the deframer returns the rest.
    for millis in [2, 100] {
        deframer.push(Instant::ZERO + Duration::from_millis(millis), &[]);
        pull(&mut deframer, &mut snapshots);
    }
    snapshots
}

fn pull(deframer: &mut Deframer<ToHost>, snapshots: &mut Vec<Snapshot>) {
    while let Some(found) = deframer.pull() {
        if let Some(Reply { address, values }) = found.ok().and_then(Reply::from_frame) {
            snapshots.push(Snapshot { address, values: values.to_vec() });
        }
    }
}

fn check(snapshot: &Snapshot) {
    let span = snapshot.span();
    assert_eq!(usize::from(span.count()), snapshot.values.len());
    assert!(usize::from(span.address()) + usize::from(span.count()) <= 256, "{span}");
    let mut again = FrameBuffer::new();
    Reply { address: snapshot.address, values: &snapshot.values }.encode(&mut again);
    assert_eq!(snapshots(&again, again.len()), std::slice::from_ref(snapshot), "parse after encode");
    assert_eq!(register_text::raw_entries(snapshot).len(), snapshot.values.len());
    check_names(snapshot);
}

/// Checks that every register of the snapshot has an entry of its own or an entry for a value of several registers. If the
/// library parses the name of an entry, the name has to mean that entry.
fn check_names(snapshot: &Snapshot) {
    let mut entries = register_text::entries(snapshot).into_iter().peekable();
    let mut row = None;
    for address in snapshot.span().addresses() {
        if let Some(entry) = entries.next_if(|entry| entry.address == address) {
            row = find_readable(address);
            let named = names::parse(&entry.name).map_or(address, |span| span.address());
            assert_eq!(named, address, "{}", entry.name);
        } else {
            assert!(row.is_some_and(|row| row.holds(address)), "{address} has no entry");
        }
    }
    assert_eq!(entries.next(), None);
}
