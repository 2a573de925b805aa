//! The messages of cameras: photo requests and answers, and the points that a camera found (manual 5).

use crate::encode::ObjectWriter;
use crate::error::EncodeError;

pub use super::instruction::Point;

/// The points of one camera: `camID` and the range of its points in the frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PointSet {
    /// `camID`.
    pub cam_id: i64,
    /// Number of the first point.
    pub(crate) first: usize,
    /// One past the last point.
    pub(crate) end: usize,
}

impl Point {
    /// Appends the point in the form of the manual's first set: numbers without quotes.
    pub(crate) fn encode(&self, out: &mut Vec<u8>) -> Result<(), EncodeError> {
        let mut object = ObjectWriter::begin(out);
        self.write(&mut object)?;
        object.end();
        Ok(())
    }
}
