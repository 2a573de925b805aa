//! The state at a glance, and the conditions that are unmet.

use r6_client::{AxisIndex, OperationMode, Readiness, Status, Unmet, Unproved};
use r6_proto::Reading;
use r6_proto::address::Address;
use serde_json::Value;

use crate::controller::{Controller, asked, settings, soon, values};

/// Reads the status of a controller that has these values, and "0" for all others.
async fn status_of(
    having: &'static [(&'static str, &'static str)],
    lacking: &'static [&'static str],
) -> Status {
    let (_controller, robot, peer) = Controller::with_robot(settings()).await;
    tokio::spawn(peer.answer_all(move |request| {
        let data: Vec<Value> = asked(request)
            .into_iter()
            .filter(|name| !lacking.contains(name))
            .map(|name| having.iter().find(|(address, _)| *address == name).map_or("0", |(_, value)| value))
            .map(Value::from)
            .collect();
        Some(values(request, data.into()))
    }));
    soon(robot.status()).await.unwrap()
}

#[tokio::test]
async fn a_machine_that_runs_and_stands_may_be_in_its_wait_step() {
    let status = status_of(
        &[
            ("version", "HC-QC-RX-7.8.07-master-F5.2.1"),
            ("curMode", "7"),
            ("origin", "1"),
            ("axisNum", "6"),
            ("axis-5", "-340.250000"),
            ("world-1", "-2597.112793"),
            ("curCycle", "1.500000"),
        ],
        &["curMold"],
    )
    .await;
    assert!(status.is_ready(), "{:?}", status.unmet());
    assert_eq!(status.readiness(None), Readiness::Unknown(vec![Unproved::RemoteStep]));
    assert_eq!(status.firmware.as_deref(), Some("HC-QC-RX-7.8.07-master-F5.2.1"));
    assert_eq!(status.mode, Some(OperationMode::Running));
    assert_eq!((status.alarm, status.homed, status.moving), (Some(0), Some(true), Some(false)));
    assert_eq!((status.axis_count, status.list_length, status.program), (Some(6), Some(0), None));
    assert_eq!((status.axes[5], status.axes[6]), (Some(-340.25), None));
    assert_eq!((status.pose[1], status.cycle), (Some(-2597.112793), Some(1.5)));
}

#[tokio::test]
async fn every_unmet_condition_is_named_with_its_remedy() {
    let status = status_of(
        &[("curMode", "2"), ("curAlarm", "135"), ("isMoving", "1"), ("RemoteCmdLen", "4"), ("origin", "0")],
        &[],
    )
    .await;
    assert_eq!(
        status.unmet(),
        [
            // Instructions that would start come before the condition that starts them.
            Unmet::Moving,
            Unmet::LeftoverList { length: 4 },
            Unmet::Alarm { code: 135 },
            Unmet::NotHomed,
            Unmet::Mode { found: OperationMode::Auto },
        ]
    );
    let mode = status.unmet()[4].to_string();
    for word in ["auto (2)", "Auto", "Cycle", "Start", "wait for remote commands"] {
        assert!(mode.contains(word), "{mode}");
    }
    for (length, wanted) in
        [(1, "1 instruction is left in the list"), (4, "4 instructions are left in the list")]
    {
        let text = Unmet::LeftoverList { length }.to_string();
        assert!(text.starts_with(wanted), "{text}");
    }
    let alarm = status.unmet()[2].to_string();
    for word in ["alarm 135", "J6", "soft limit"] {
        assert!(alarm.contains(word), "{alarm}");
    }
}

#[tokio::test]
async fn what_is_not_known_counts_against_it_but_for_the_list() {
    let status = status_of(&[("curMode", "7")], &["origin", "RemoteCmdLen", "curMold"]).await;
    assert_eq!(status.unmet(), [Unmet::Unknown { address: Address::Origin }]);
    assert_eq!(status.list_length, None);
}

/// It may have instructions, and the firmware reports its length.
#[tokio::test]
async fn a_list_length_that_cannot_be_read_is_not_a_missing_one() {
    const WORD: [(&str, &str); 3] = [("curMode", "7"), ("origin", "1"), ("RemoteCmdLen", "24x")];
    const HUGE: [(&str, &str); 3] =
        [("curMode", "7"), ("origin", "1"), ("RemoteCmdLen", "99999999999999999999")];
    for having in [&WORD, &HUGE] {
        let status = status_of(having, &[]).await;
        let unknown = Unmet::Unknown { address: Address::RemoteCmdLen };
        assert_eq!((status.unmet(), status.list_length), (vec![unknown], None), "{having:?}");
        assert_eq!(status.unproved(None), [Unproved::RemoteStep], "{having:?}");
    }
}

/// The values fit any step of any program. Only a program name that the caller knows proves the wait step.
#[tokio::test]
async fn no_value_proves_the_wait_step_but_the_name_of_a_program_that_is_known() {
    const MET: [(&str, &str); 3] = [("curMode", "7"), ("origin", "1"), ("curMold", "wait-for-pc")];
    let told = status_of(&MET, &[]).await;
    assert_eq!(told.readiness(None), Readiness::Unknown(vec![Unproved::RemoteStep]));
    assert_eq!(told.readiness(Some("other")), Readiness::NotReady(vec![Unmet::OtherProgram]));
    assert_eq!(told.readiness(Some("wait-for-pc")), Readiness::Ready);
    // The mainboard's port does not report the program.
    let untold = status_of(&MET, &["curMold"]).await;
    assert_eq!(untold.readiness(Some("wait-for-pc")), Readiness::Unknown(vec![Unproved::RemoteStep]));
    let list_untold = status_of(&MET, &["RemoteCmdLen"]).await;
    assert_eq!(list_untold.readiness(Some("wait-for-pc")), Readiness::Unknown(vec![Unproved::ListLength]));
    // Unmet conditions come first: a program that does not run waits for nothing.
    let stopped = status_of(&[("curMode", "3"), ("origin", "1"), ("curMold", "wait-for-pc")], &[]).await;
    let unmet = vec![Unmet::Mode { found: OperationMode::Stop }];
    assert_eq!(stopped.readiness(Some("wait-for-pc")), Readiness::NotReady(unmet));
}

#[tokio::test]
async fn each_value_of_the_status_is_found_by_its_address() {
    let status = status_of(
        &[
            ("version", "F5"),
            ("machineName", "cell 9"),
            ("curMold", "wait-for-pc"),
            ("curMode", "3"),
            ("curAlarm", "135"),
            ("origin", "1"),
            ("isMoving", "1"),
            ("axisNum", "4"),
            ("axis-2", "12.500000"),
            ("world-1", "-7.250000"),
            ("RemoteCmdLen", "8"),
            ("curCycle", "1.500000"),
            ("lastCycle", "2.500000"),
        ],
        &[],
    )
    .await;
    let text = |text: &str| Reading::Text(text.to_owned());
    for (address, wanted) in [
        (Address::Version, text("F5")),
        (Address::MachineName, text("cell 9")),
        (Address::CurMold, text("wait-for-pc")),
        (Address::CurMode, Reading::Integer(3)),
        (Address::CurAlarm, Reading::Integer(135)),
        (Address::Origin, Reading::Flag(true)),
        (Address::IsMoving, Reading::Flag(true)),
        (Address::AxisNum, Reading::Integer(4)),
        (Address::Axis(AxisIndex::ALL[2]), Reading::Decimal(12.5)),
        (Address::World(AxisIndex::ALL[1]), Reading::Decimal(-7.25)),
        (Address::RemoteCmdLen, Reading::Integer(8)),
        (Address::CurCycle, Reading::Decimal(1.5)),
        (Address::LastCycle, Reading::Decimal(2.5)),
    ] {
        assert_eq!(status.reading(address), Some(wanted), "{address}");
    }
    // The status does not read the seventh axis, nor the moulds.
    assert_eq!(status.reading(Address::Axis(AxisIndex::ALL[6])), None);
    assert_eq!(status.reading(Address::MoldList), None);
}
