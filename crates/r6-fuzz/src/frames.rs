//! Fuzzes frame boundaries. However a stream is split, it gives the same frames and errors, and these are the
//! ones that a plain scanner finds. The same holds when the stream is read as a recording.
//!
//! An input is a byte for the limits, a byte for the pieces, and the stream.

mod recording;
mod scanner;

use r6_proto::frame::{FrameBuffer, FrameError, Limits, READ_ROOM};

use crate::input::Input;

/// An event of a buffer.
#[derive(Clone, Debug, PartialEq, Eq)]
enum FoundFrame {
    Frame { offset: u64, bytes: Vec<u8> },
    Fault(FrameError),
}

const FRAME_BYTES: [usize; 6] = [65_536, 2, 16, 40, 200, 4096];
const DEPTHS: [usize; 5] = [32, 1, 2, 3, 64];

/// Runs one input.
pub fn run(bytes: &[u8]) {
    let mut input = Input::new(bytes);
    let limits = Limits { max_frame_bytes: input.pick(&FRAME_BYTES), max_depth: input.pick(&DEPTHS) };
    let pieces = input.byte();
    let stream = input.rest();

    let whole = told(stream, limits, &mut |left| left);
    assert_eq!(told(stream, limits, &mut |_| 1), whole, "byte by byte it is another stream");
    let mut length = usize::from(pieces);
    let mut uneven = |_| {
        length = (length * 37 + 11) % 150;
        length + 1
    };
    assert_eq!(told(stream, limits, &mut uneven), whole, "in pieces it is another stream");

    for told in &whole {
        if let FoundFrame::Frame { offset, bytes } = told {
            let at = usize::try_from(*offset).unwrap();
            assert_eq!(stream.get(at..at + bytes.len()), Some(&bytes[..]), "a frame is what was received");
            assert!(bytes.len() <= limits.max_frame_bytes && bytes[0] == b'{' && bytes.ends_with(b"}"));
        }
    }
    // In GBK, a quote or a backslash may be the second byte of a character. The plain scanner does not
    // support this.
    if std::str::from_utf8(stream).is_ok() {
        let found: Vec<_> = whole.iter().map(plain).collect();
        assert_eq!(found, scanner::scan(stream, limits), "the plain scanner disagrees");
    }

    recording::check_log(stream);
    // Recordings are read with the limits of a connection.
    let told = told(stream, Limits::default(), &mut |left| left);
    recording::check_transcript(stream, usize::from(pieces) + 1, &told);
}

/// The part that the plain scanner also reports: where frames and faults begin, and the kind of fault.
fn plain(told: &FoundFrame) -> scanner::Found {
    match told {
        FoundFrame::Frame { offset, bytes } => scanner::Found::Frame { at: *offset, length: bytes.len() },
        FoundFrame::Fault(error) => scanner::Found::Fault { at: error.stream_offset, fault: error.fault },
    }
}

/// Pushes the stream in pieces and collects the buffer's events. It checks the limits of the buffer in
/// between.
fn told(stream: &[u8], limits: Limits, piece: &mut dyn FnMut(usize) -> usize) -> Vec<FoundFrame> {
    let mut buffer = FrameBuffer::new(limits);
    let mut told = Vec::new();
    let mut rest = stream;
    while !rest.is_empty() {
        let (now, later) = rest.split_at(piece(rest.len()).clamp(1, rest.len()));
        feed(&mut buffer, now, limits, &mut told);
        rest = later;
        let come = stream.len() - rest.len();
        assert!(buffer.pending() <= come, "more is pending than ever came");
    }
    // A byte is examined once, and moved at most twice.
    let most = 4 * stream.len() as u64 + READ_ROOM as u64;
    assert!(buffer.examined() <= most, "{} looks at {} bytes", buffer.examined(), stream.len());
    let pending = buffer.pending();
    let abandoned = buffer.abandon_partial();
    assert!(abandoned.is_none() || pending > 0);
    told.extend(abandoned.map(FoundFrame::Fault));
    assert_eq!(buffer.abandon_partial(), None, "what was given up is given up once");
    told
}

fn feed(buffer: &mut FrameBuffer, mut bytes: &[u8], limits: Limits, told: &mut Vec<FoundFrame>) {
    loop {
        let taken = if bytes.len().is_multiple_of(2) {
            buffer.push(bytes)
        } else {
            let room = buffer.spare_mut();
            let count = room.len().min(bytes.len());
            room[..count].copy_from_slice(&bytes[..count]);
            buffer.commit(count);
            count
        };
        while let Some(next) = buffer.next() {
            told.push(match next {
                Ok(frame) => FoundFrame::Frame { offset: frame.stream_offset, bytes: frame.bytes.to_vec() },
                Err(error) => {
                    assert!(error.first_bytes().len() <= 16 && !error.to_string().is_empty());
                    FoundFrame::Fault(error)
                }
            });
        }
        let room = buffer.spare_mut().len();
        assert!(room > 0 && room <= limits.max_frame_bytes + READ_ROOM, "room for {room} bytes");
        bytes = &bytes[taken..];
        if bytes.is_empty() {
            return;
        }
        assert!(taken > 0, "a drained buffer takes bytes");
    }
}
