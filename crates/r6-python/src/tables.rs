//! The tables of the protocol: alarms and addresses.

use pyo3::prelude::*;
use r6_controller::{Profile, RobotModel};
use r6_proto::address::{ADDRESSES, Ports};
use r6_proto::alarm::AlarmCode;

use crate::record::Record;

/// What an alarm means and what to do about it.
#[pyfunction]
pub fn alarm(py: Python<'_>, code: u32) -> PyResult<Bound<'_, PyAny>> {
    let alarm = AlarmCode(code).decode();
    Record::new(py, "Alarm")?
        .with("code", code)?
        .with("text", alarm.text)?
        .with("axis", alarm.axis.map(r6_client::AxisIndex::number))?
        .with("remedy", alarm.remedy)?
        .with("seen_live", alarm.seen_live)?
        .with("known", alarm.known)?
        .build()
}

/// Every address that can be read, in the manual's order.
#[pyfunction]
pub fn addresses(py: Python<'_>) -> PyResult<Vec<Bound<'_, PyAny>>> {
    let row = |info: &r6_proto::address::AddressInfo| {
        let ports = match info.ports {
            Ports::Both => "both",
            Ports::Mainboard => "mainboard",
            Ports::Pendant => "pendant",
        };
        Record::new(py, "AddressInfo")?
            .with("name", info.name)?
            .with("indices", info.indices)?
            .with("value", info.value.to_string())?
            .with("unit", info.unit)?
            .with("meaning", info.meaning)?
            .with("ports", ports)?
            .with("since", info.since)?
            .with("source", info.source)?
            .build()
    };
    ADDRESSES.iter().map(row).collect()
}

/// The names of the profiles that come with the package; the first is the default.
#[pyfunction]
pub fn profiles() -> Vec<&'static str> {
    Profile::names().to_vec()
}

/// The names of the robot models that come with the package; the first is the default.
#[pyfunction]
pub fn models() -> Vec<&'static str> {
    RobotModel::names().collect()
}
