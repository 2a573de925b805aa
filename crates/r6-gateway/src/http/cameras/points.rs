//! The points in the body of a request. Their mistakes are told with the number of the point and its field.

use axum::extract::{FromRequest, Request};
use r6_api::Code;
use r6_api::gateway::{CameraPoint, PointsRequest};
use r6_http::Refusal;
use serde_json::{Map, Value};

use super::super::body::{MAX_BYTES, json_bytes};
use super::{State, bad_value};

/// The fields of a point, and what each of them has to be.
const FIELDS: [(&str, Wanted); 10] = [
    ("model_id", Wanted::Whole),
    ("x", Wanted::Number),
    ("y", Wanted::Number),
    ("z", Wanted::NumberOrNull),
    ("u", Wanted::NumberOrNull),
    ("v", Wanted::NumberOrNull),
    ("angle", Wanted::NumberOrNull),
    ("similarity", Wanted::NumberOrNull),
    ("color", Wanted::WholeOrNull),
    ("relative", Wanted::Truth),
];

/// The fields that each point has.
const REQUIRED: [&str; 2] = ["x", "y"];

/// The points that a camera found.
#[derive(Debug)]
pub struct Points(pub Vec<CameraPoint>);

impl FromRequest<State> for Points {
    type Rejection = Refusal;

    async fn from_request(request: Request, state: &State) -> Result<Self, Refusal> {
        let body = json_bytes(request, state, MAX_BYTES).await?;
        match serde_json::from_slice::<PointsRequest>(&body) {
            Ok(PointsRequest { points }) => Ok(Self(points)),
            Err(error) => Err(match serde_json::from_slice(&body).ok().and_then(|body| mistake(&body)) {
                Some(mistake) => bad_value(mistake),
                None => Refusal::of_json(&error, Code::BadValue),
            }),
        }
    }
}

/// What a field has to be.
#[derive(Clone, Copy)]
enum Wanted {
    Number,
    NumberOrNull,
    Whole,
    WholeOrNull,
    Truth,
}

impl Wanted {
    fn fits(self, value: &Value) -> bool {
        match self {
            Self::Number => value.is_number(),
            Self::NumberOrNull => value.is_number() || value.is_null(),
            Self::Whole => value.is_i64(),
            Self::WholeOrNull => value.is_i64() || value.is_null(),
            Self::Truth => value.is_boolean(),
        }
    }

    fn words(self) -> &'static str {
        match self {
            Self::Number | Self::NumberOrNull => "a number",
            Self::Whole | Self::WholeOrNull => "a whole number",
            Self::Truth => "true or false",
        }
    }
}

/// The first mistake of a body, for people. `None` if it is another one than those that are looked for here.
fn mistake(body: &Value) -> Option<String> {
    let Some(points) = body.get("points").and_then(Value::as_array) else {
        return Some(
            "`points` has to be a list of points, such as [{\"x\": 888.0, \"y\": 1345.0}]".to_owned(),
        );
    };
    points.iter().zip(1..).find_map(|(point, number)| {
        let mistake = match point.as_object() {
            Some(point) => of_point(point)?,
            None => "it has to be an object, such as {\"x\": 888.0, \"y\": 1345.0}".to_owned(),
        };
        Some(format!("point {number} of {}: {mistake}", points.len()))
    })
}

fn of_point(point: &Map<String, Value>) -> Option<String> {
    if let Some(missing) = REQUIRED.iter().find(|field| !point.contains_key(**field)) {
        return Some(format!("`{missing}` is missing"));
    }
    point.iter().find_map(|(field, value)| match FIELDS.iter().find(|(known, _)| known == field) {
        Some((_, wanted)) if wanted.fits(value) => None,
        Some((_, wanted)) => Some(format!("`{field}` has to be {}", wanted.words())),
        None => {
            let field: String = field.chars().take(40).collect();
            let near = r6_proto::nearest(&field, FIELDS.iter().map(|(known, _)| *known));
            let near = near.map_or_else(String::new, |near| format!("; nearest: `{near}`"));
            Some(format!("there is no field `{}`{near}", r6_proto::printable(&field)))
        }
    })
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn a_mistake_names_the_point_and_its_field() {
        for (points, told) in [
            (json!([{ "x": 1, "y": 2 }, { "x": 1 }]), "point 2 of 2: `y` is missing"),
            (json!([{ "x": "1", "y": 2 }]), "point 1 of 1: `x` has to be a number"),
            (json!([{ "x": 1, "y": 2, "color": "red" }]), "point 1 of 1: `color` has to be a whole number"),
            (
                json!([{ "x": 1, "y": 2, "model_id": 1.5 }]),
                "point 1 of 1: `model_id` has to be a whole number",
            ),
            (json!([{ "x": 1, "y": 2, "relative": 1 }]), "point 1 of 1: `relative` has to be true or false"),
            (
                json!([{ "x": 1, "y": 2, "angel": 3 }]),
                "point 1 of 1: there is no field `angel`; nearest: `angle`",
            ),
            (json!([7]), "point 1 of 1: it has to be an object, such as {\"x\": 888.0, \"y\": 1345.0}"),
        ] {
            let body = json!({ "points": points });
            assert!(serde_json::from_value::<PointsRequest>(body.clone()).is_err(), "{body}");
            assert_eq!(mistake(&body).as_deref(), Some(told), "{body}");
        }
        assert!(mistake(&json!([])).unwrap().starts_with("`points` has to be a list"));
        // What is right has no mistake, so that the reader of the body decides alone.
        let full = json!({ "points": [{ "model_id": -1, "x": 1.5, "y": 2, "z": null, "u": 1, "v": 2, "angle": 3,
            "similarity": 0.5, "color": 255, "relative": true }] });
        assert!(serde_json::from_value::<PointsRequest>(full.clone()).is_ok());
        assert_eq!(mistake(&full), None);
    }
}
