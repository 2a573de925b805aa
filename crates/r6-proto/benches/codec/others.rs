//! The frames as typed serde structs, which serde_json and sonic-rs read and write.
//!
//! The differences favour them: their structs accept one form of each frame. They handle no other spelling,
//! nothing repeated, unquoted or in GBK, and no error that names a field.

use r6_proto::message::Point;
use r6_proto::message::instruction::{Action, Instruction};
use r6_proto::{Address, AxisIndex, AxisMask};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::samples::sum_of_addresses;

/// A decimal number in quotes.
pub struct Quoted<const DECIMALS: usize>(pub f64);

impl<'de, const DECIMALS: usize> Deserialize<'de> for Quoted<DECIMALS> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = <&str>::deserialize(deserializer)?;
        text.parse().map(Self).map_err(serde::de::Error::custom)
    }
}

impl<const DECIMALS: usize> Serialize for Quoted<DECIMALS> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(&format_args!("{:.DECIMALS$}", self.0))
    }
}

/// A mask as `0x3F`.
pub struct Mask(u8);

impl<'de> Deserialize<'de> for Mask {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = <&str>::deserialize(deserializer)?;
        let digits = text.strip_prefix("0x").ok_or_else(|| serde::de::Error::custom("no mask"))?;
        u8::from_str_radix(digits, 16).map(Self).map_err(serde::de::Error::custom)
    }
}

impl Serialize for Mask {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(&format_args!("0x{:02X}", self.0))
    }
}

#[derive(Deserialize, Serialize)]
pub struct QueryFrame<'a> {
    #[serde(rename = "dsID")]
    pub ds_id: &'a str,
    #[serde(rename = "reqType")]
    pub req_type: &'a str,
    #[serde(rename = "packID")]
    pub pack_id: &'a str,
    #[serde(rename = "queryAddr", borrow)]
    pub query_addr: Vec<&'a str>,
}

#[derive(Deserialize, Serialize)]
pub struct ReplyFrame<'a> {
    #[serde(rename = "dsID")]
    pub ds_id: &'a str,
    #[serde(rename = "packID")]
    pub pack_id: &'a str,
    #[serde(rename = "queryData")]
    pub query_data: Vec<Quoted<6>>,
    #[serde(rename = "reqType")]
    pub req_type: &'a str,
}

#[derive(Deserialize, Serialize)]
pub struct AddRccFrame<'a> {
    #[serde(rename = "dsID")]
    pub ds_id: &'a str,
    #[serde(rename = "reqType")]
    pub req_type: &'a str,
    #[serde(rename = "packID")]
    pub pack_id: &'a str,
    #[serde(rename = "emptyList")]
    pub empty_list: Quoted<0>,
    pub instructions: Vec<Step>,
}

#[derive(Deserialize, Serialize)]
pub struct Step {
    pub oneshot: Quoted<0>,
    pub action: Quoted<0>,
    pub m0: Quoted<3>,
    pub m1: Quoted<3>,
    pub m2: Quoted<3>,
    pub m3: Quoted<3>,
    pub m4: Quoted<3>,
    pub m5: Quoted<3>,
    #[serde(rename = "ckStatus")]
    pub ck_status: Mask,
    pub speed: Quoted<1>,
    pub delay: Quoted<1>,
    pub smooth: Quoted<0>,
}

#[derive(Deserialize, Serialize)]
pub struct AddPointsFrame<'a> {
    #[serde(rename = "dsID")]
    pub ds_id: &'a str,
    #[serde(rename = "reqType")]
    pub req_type: &'a str,
    #[serde(rename = "packID")]
    pub pack_id: &'a str,
    #[serde(rename = "dsData")]
    pub ds_data: Vec<Camera>,
}

#[derive(Deserialize, Serialize)]
pub struct Camera {
    #[serde(rename = "camID")]
    pub cam_id: i64,
    pub data: Vec<Part>,
}

#[derive(Deserialize, Serialize)]
#[serde(rename_all = "PascalCase")]
pub struct Part {
    #[serde(rename = "ModelID")]
    pub model_id: i64,
    pub x: f64,
    pub y: f64,
    pub z: f64,
    pub u: f64,
    pub v: f64,
    pub angel: f64,
    pub similarity: f64,
    pub color: i64,
    pub rel: u8,
}

pub fn step(instruction: &Instruction) -> Step {
    let Action::AxisMove(motion) = &instruction.action else { panic!("{instruction:?}") };
    let m = |axis: usize| Quoted(motion.target.at(AxisIndex::ALL[axis]).unwrap_or(0.0));
    let manner = &motion.manner;
    Step {
        oneshot: Quoted(1.0),
        action: Quoted(4.0),
        m0: m(0),
        m1: m(1),
        m2: m(2),
        m3: m(3),
        m4: m(4),
        m5: m(5),
        ck_status: Mask(manner.mask.map_or(0, AxisMask::bits)),
        speed: Quoted(manner.speed.unwrap_or(0.0)),
        delay: Quoted(manner.delay.unwrap_or(0.0)),
        smooth: Quoted(manner.smooth.map_or(0.0, |level| f64::from(level.level()))),
    }
}

pub fn part(point: &Point) -> Part {
    Part {
        model_id: point.model_id,
        x: point.x,
        y: point.y,
        z: point.z.unwrap_or(0.0),
        u: point.u.unwrap_or(0.0),
        v: point.v.unwrap_or(0.0),
        angel: point.angle.unwrap_or(0.0),
        similarity: point.similarity.unwrap_or(0.0),
        color: point.color.unwrap_or(0),
        rel: u8::from(point.relative),
    }
}

/// The work that both other contenders do with a parsed frame.
pub trait Summed<'a>: Deserialize<'a> {
    fn sum(&self) -> f64;
}

impl<'a> Summed<'a> for QueryFrame<'a> {
    fn sum(&self) -> f64 {
        sum_of_addresses(self.query_addr.iter().map(|name| Address::exact(name.as_bytes())))
    }
}

impl<'a> Summed<'a> for ReplyFrame<'a> {
    fn sum(&self) -> f64 {
        self.query_data.iter().map(|value| value.0).sum()
    }
}

impl<'a> Summed<'a> for AddRccFrame<'a> {
    fn sum(&self) -> f64 {
        let one = |step: &Step| {
            let target: f64 =
                [&step.m0, &step.m1, &step.m2, &step.m3, &step.m4, &step.m5].map(|m| m.0).iter().sum();
            target + f64::from(step.ck_status.0) + step.speed.0 + step.delay.0 + step.smooth.0
        };
        self.instructions.iter().map(one).sum()
    }
}

impl<'a> Summed<'a> for AddPointsFrame<'a> {
    fn sum(&self) -> f64 {
        let one = |part: &Part| {
            let turned = part.u + part.v + part.angel;
            let rest = part.similarity + part.color as f64;
            part.model_id as f64 + part.x + part.y + part.z + turned + rest + f64::from(part.rel)
        };
        let camera = |camera: &Camera| {
            let cam_id = camera.cam_id as f64;
            camera.data.iter().map(|part| cam_id + one(part)).sum::<f64>()
        };
        self.ds_data.iter().map(camera).sum()
    }
}

pub fn by_serde_json<'a, T: Summed<'a>>(frame: &'a [u8]) -> f64 {
    serde_json::from_slice::<T>(frame).expect("a frame of ours").sum()
}

pub fn by_sonic_rs<'a, T: Summed<'a>>(frame: &'a [u8]) -> f64 {
    sonic_rs::from_slice::<T>(frame).expect("a frame of ours").sum()
}
