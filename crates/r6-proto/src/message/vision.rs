//! The camera's side: photo requests and answers, and the points that a camera found (manual 5).

use crate::encode::{Decimals, ObjectWriter, key};
use crate::error::{EncodeError, FieldError};
use crate::message::fields::{Fields, FieldsView};

/// One part that a camera found, in the calibrated world of the robot (manual 5.2).
///
/// What is left out is not written, and not read as 0: the tool keeps it. The manual always has all of X to `Angel`; what a shipped
/// controller does with a point that lacks one is not known, so give all six where the wrist matters.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Point {
    /// `ModelID`: the template that recognised it.
    pub model_id: i64,
    /// `X`, mm.
    pub x: f64,
    /// `Y`, mm.
    pub y: f64,
    /// `Z`, mm; left out, the tool stays as high as it is.
    pub z: Option<f64>,
    /// `U`, degrees; left out, it stays as it is. A four-axis robot has none.
    pub u: Option<f64>,
    /// `V`, degrees; left out, it stays as it is. A four-axis robot has none.
    pub v: Option<f64>,
    /// `Angel` (the wire's spelling), degrees: W, or U on a four-axis robot; left out, it stays as it is.
    pub angle: Option<f64>,
    /// `Similarity`; its range is left open by the manual.
    pub similarity: Option<f64>,
    /// `Color`; its range is left open by the manual.
    pub color: Option<i64>,
    /// `Rel`: the coordinates are relative.
    pub relative: bool,
}

/// The points of one camera: `camID` and where they stand in the frame's points.
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
        const MM: &str = "a finite number of mm";
        const DEGREES: &str = "a finite number of degrees";
        Ok(Self {
            model_id: fields
                .optional(Fields::MODEL_ID, "a whole number", |value| value.integer())?
                .unwrap_or(0),
            x: fields.required(Fields::X, MM, |value| value.number())?,
            y: fields.required(Fields::Y, MM, |value| value.number())?,
            z: fields.optional(Fields::Z, MM, |value| value.number())?,
            u: fields.optional(Fields::U, DEGREES, |value| value.number())?,
            v: fields.optional(Fields::V, DEGREES, |value| value.number())?,
            angle: fields.optional(Fields::ANGEL, DEGREES, |value| value.number())?,
            similarity: fields.optional(Fields::SIMILARITY, "a finite number", |value| value.number())?,
            color: fields.optional(Fields::COLOR, "a whole number", |value| value.integer())?,
            relative: fields.optional(Fields::REL, "1 or 0", |value| value.flag())?.unwrap_or(false),
        })
    }

    /// Appends the point as the manual's first set writes it: numbers without quotes.
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
