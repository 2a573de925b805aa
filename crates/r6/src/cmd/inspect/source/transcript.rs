//! Transcripts: whole conversations, one write of one side a line (`vectors/README.md`).

use r6_proto::frame::{FrameBuffer, Limits};
use serde::Deserialize;

use super::{At, Piece, Pieces, Side};

/// One line of a transcript: one write of one side.
#[derive(Deserialize)]
struct Write {
    from: Side,
    bytes: String,
}

/// The first line of a transcript.
#[derive(Deserialize)]
struct About {
    #[serde(rename = "about")]
    _about: String,
}

/// Reads the input as a transcript, if every line is one of a transcript.
pub fn read(input: &[u8]) -> Option<Pieces> {
    let text = std::str::from_utf8(input).ok()?;
    let mut sides = [Stream::new(Side::Pc), Stream::new(Side::Controller)];
    let mut pieces = Pieces::default();
    let mut writes = 0;
    for (number, line) in (1..).zip(text.lines()) {
        if line.trim().is_empty() || serde_json::from_str::<About>(line).is_ok() {
            continue;
        }
        let write: Write = serde_json::from_str(line).ok()?;
        writes += 1;
        let stream = sides.iter_mut().find(|stream| stream.side == write.from)?;
        stream.take(write.bytes.as_bytes(), number, &mut pieces.list);
    }
    for stream in &mut sides {
        stream.end(&mut pieces.list);
    }
    (writes > 0).then_some(pieces)
}

/// The bytes of one side.
struct Stream {
    side: Side,
    frames: FrameBuffer,
    line: usize,
}

impl Stream {
    fn new(side: Side) -> Self {
        Self { side, frames: FrameBuffer::new(Limits::default()), line: 0 }
    }

    fn at(&self, stream_offset: u64) -> At {
        At { offset: usize::try_from(stream_offset).unwrap_or(usize::MAX), line: self.line }
    }

    fn take(&mut self, bytes: &[u8], line: usize, list: &mut Vec<Piece>) {
        self.line = line;
        let mut rest = bytes;
        while !rest.is_empty() {
            let taken = self.frames.push(rest);
            rest = rest.get(taken..).unwrap_or_default();
            loop {
                let piece = match self.frames.next() {
                    None => break,
                    Some(Ok(frame)) => (frame.stream_offset, Ok(frame.bytes.to_vec())),
                    Some(Err(error)) => (error.stream_offset, Err(error.to_string())),
                };
                let (at, from) = (self.at(piece.0), Some(self.side));
                list.push(match piece.1 {
                    Ok(bytes) => Piece::Frame { at, from, bytes },
                    Err(error) => Piece::Broken { at, from, error },
                });
            }
        }
    }

    fn end(&mut self, list: &mut Vec<Piece>) {
        if let Some(error) = self.frames.abandon_partial() {
            list.push(Piece::Broken {
                at: self.at(error.stream_offset),
                from: Some(self.side),
                error: error.to_string(),
            });
        }
    }
}
