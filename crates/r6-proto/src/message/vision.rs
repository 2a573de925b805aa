//! The messages of cameras: photo requests and answers, and the points that a camera found (manual 5).

use crate::encode::{Decimals, ObjectWriter, key};
use crate::error::{EncodeError, FieldError, Wanted};
use crate::message::fields::{Fields, FieldsView};

/// One part that a camera found, in the robot's calibrated world (manual 5.2).
///
/// A coordinate that is left out is not written, and is not read as 0: the tool keeps its present value. The
/// manual always shows all of X to `Angel`. It is not known what a shipped controller does with an incomplete
/// point, so give all six if the wrist matters.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Point {
    /// `ModelID`: the template that recognised the part.
    pub model_id: i64,
    /// `X`, mm.
    pub x: f64,
    /// `Y`, mm.
    pub y: f64,
    /// `Z`, mm. If it is left out, the tool keeps its height.
    pub z: Option<f64>,
    /// `U`, degrees. If it is left out, the tool keeps its U. A four-axis robot has no U.
    pub u: Option<f64>,
    /// `V`, degrees. If it is left out, the tool keeps its V. A four-axis robot has no V.
    pub v: Option<f64>,
    /// `Angel` (the wire's spelling), degrees: W, or U on a four-axis robot. If it is left out, the tool
    /// keeps its angle.
    pub angle: Option<f64>,
    /// `Similarity`. The manual does not give its range.
    pub similarity: Option<f64>,
    /// `Color`. The manual does not give its range.
    pub color: Option<i64>,
    /// `Rel`: the coordinates are relative.
    pub relative: bool,
}

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
    pub(crate) fn from_fields(fields: &mut FieldsView<'_>) -> Result<Self, FieldError> {
        const MM: Wanted = Wanted(&["a finite number of mm", "有限的毫米数"]);
        const DEGREES: Wanted = Wanted(&["a finite number of degrees", "有限的角度"]);
        Ok(Self {
            model_id: fields
                .optional(Fields::MODEL_ID, Wanted(&["a whole number", "整数"]), |value| value.integer())?
                .unwrap_or(0),
            x: fields.required(Fields::X, MM, |value| value.number())?,
            y: fields.required(Fields::Y, MM, |value| value.number())?,
            z: fields.optional(Fields::Z, MM, |value| value.number())?,
            u: fields.optional(Fields::U, DEGREES, |value| value.number())?,
            v: fields.optional(Fields::V, DEGREES, |value| value.number())?,
            angle: fields.optional(Fields::ANGEL, DEGREES, |value| value.number())?,
            similarity: fields.optional(
                Fields::SIMILARITY,
                Wanted(&["a finite number", "有限的数"]),
                |value| value.number(),
            )?,
            color: fields
                .optional(Fields::COLOR, Wanted(&["a whole number", "整数"]), |value| value.integer())?,
            relative: fields
                .optional(Fields::REL, Wanted(&["1 or 0", "1 或 0"]), |value| value.flag())?
                .unwrap_or(false),
        })
    }

    /// Appends the point in the form of the manual's first set: numbers without quotes.
    pub(crate) fn encode(&self, out: &mut Vec<u8>) -> Result<(), EncodeError> {
        let mut object = ObjectWriter::begin(out);
        object.bare_integer(key!("ModelID"), self.model_id);
        for (key, value) in [
            (key!("X"), Some(self.x)),
            (key!("Y"), Some(self.y)),
            (key!("Z"), self.z),
            (key!("U"), self.u),
            (key!("V"), self.v),
            (key!("Angel"), self.angle),
        ] {
            if let Some(value) = value {
                object.bare_fixed(key, value, Decimals::POSITION)?;
            }
        }
        if let Some(similarity) = self.similarity {
            object.bare_fixed(key!("Similarity"), similarity, Decimals::FEW)?;
        }
        if let Some(color) = self.color {
            object.bare_integer(key!("Color"), color);
        }
        object.bare_integer(key!("Rel"), i64::from(self.relative));
        object.end();
        Ok(())
    }
}
