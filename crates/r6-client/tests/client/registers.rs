//! Registers: an ok proves nothing.

use r6_client::{Keep, NotSent, RegisterError, RegisterIndex, RequestError, Robot};
use serde_json::{Value, json};

use crate::controller::{Controller, asked, command_word, settings, values, verdict};

fn register(number: u16) -> RegisterIndex {
    RegisterIndex::new(number).unwrap()
}

/// Writes two registers on a controller that answers ok to everything and then has these values.
async fn write(written: [i32; 2], afterwards: Value) -> (Result<(), RegisterError>, Vec<Value>) {
    let (_controller, robot, peer) = Controller::with_robot(settings()).await;
    let mut requests = Vec::new();
    let result = {
        let serving = peer.answer_all(|request| {
            requests.push(request.clone());
            Some(if command_word(request).is_empty() {
                // A query for one register alone gets one value, or none.
                match (asked(request).as_slice(), afterwards.as_array()) {
                    ([one], Some(list)) => {
                        let at = usize::from(*one == "Addr-801");
                        values(request, list.get(at).map_or(json!([]), |value| json!([value])))
                    }
                    _ => values(request, afterwards.clone()),
                }
            } else {
                verdict(request, &[command_word(request), "ok"])
            })
        });
        let writing = async {
            let result = robot.write_registers(register(800), &written, Keep::UntilPowerCut).await;
            robot.close().await;
            result
        };
        tokio::join!(writing, serving).0
    };
    (result, requests)
}

#[tokio::test]
async fn what_was_written_is_read_back() {
    let (result, requests) = write([-456_754, 826], json!(["-456754", "826"])).await;
    result.unwrap();
    assert_eq!(requests[0]["cmdData"], json!(["rewriteDataList", "800", "2", "0", "-456754", "826"]));
    assert_eq!(asked(&requests[1]), ["Addr-800", "Addr-801"]);
    assert_eq!(requests.len(), 2, "written once, read once");
}

#[tokio::test]
async fn ok_and_another_value_is_told() {
    let (result, _) = write([10, 20], json!(["10", "7"])).await;
    let error = result.unwrap_err();
    assert_eq!(error, RegisterError::Differs { register: register(801), wrote: 20, found: 7 });
    assert!(error.to_string().contains("register 801 has 7 and not 20, although the controller said ok"));
}

#[tokio::test]
async fn firmware_that_does_not_tell_registers_is_told() {
    let (result, requests) = write([10, 20], json!([])).await;
    assert_eq!(result.unwrap_err(), RegisterError::NotReadable { register: register(800) });
    let written = requests.iter().filter(|request| !command_word(request).is_empty());
    assert_eq!(written.count(), 1);
}

#[tokio::test]
async fn one_register_alone_is_written_as_one() {
    let (_controller, robot, mut peer) = Controller::with_robot(settings()).await;
    let writing = robot.write_registers(register(900), &[5], Keep::Always);
    let (result, ()) = tokio::join!(writing, async {
        let request = peer.frame().await;
        assert_eq!(request["cmdData"], json!(["rewriteData", "900", "5", "1"]));
        peer.send(verdict(&request, &["rewriteData", "ok"])).await;
        let request = peer.frame().await;
        peer.send(values(&request, json!(["5"]))).await;
    });
    result.unwrap();
}

#[tokio::test]
async fn what_goes_beyond_the_last_register_is_not_sent() {
    let (_controller, robot, peer) = Controller::with_robot(settings()).await;
    let refused = async |robot: &Robot, values: &[i32]| {
        robot.write_registers(register(899), values, Keep::UntilPowerCut).await.unwrap_err()
    };
    for values in [&[1, 2, 3][..], &[]] {
        let error = refused(&robot, values).await;
        assert!(matches!(error, RegisterError::NoSuchRegisters { .. }), "{error}");
    }
    robot.clone().close().await;
    let error = refused(&robot, &[1]).await;
    assert_eq!(error, RegisterError::Request(RequestError::NotSent(NotSent::Closed)));
    let mut peer = peer;
    peer.ends().await;
}
