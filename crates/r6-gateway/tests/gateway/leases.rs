//! Leases: one holder at a time, who must renew.

use r6_gateway::RobotConfig;
use serde_json::json;

use crate::support::{Hall, commands, name};

const LEASE: &str = "/v1/robots/press/lease";

#[tokio::test]
async fn one_holds_the_lease_and_the_other_is_told_who() {
    let hall = Hall::start().await;
    let first = hall.lease(&hall.operator, "press").await;
    // The same token in another script is another holder.
    for (token, is_own) in [(&hall.admin, false), (&hall.operator, true)] {
        let (status, problem) = hall.post(token, LEASE, &json!({})).await;
        assert_eq!((status, &problem["code"]), (409, &json!("leased")));
        let message = problem["message"].as_str().unwrap();
        assert!(message.starts_with("token 2 (operator) holds the lease"), "{problem}");
        assert_eq!(message.contains("that is your own name"), is_own, "{problem}");
    }
    let seen = hall.get(&hall.viewer, "/v1/robots/press").await["lease"].clone();
    assert_eq!((&seen["number"], &seen["holder"]), (&first["number"], &json!("token 2 (operator)")));
    assert_eq!(seen.get("secret"), None);

    // The number alone is not enough, nor is the secret.
    let guessed = json!({ "number": first["number"], "secret": "0".repeat(32) });
    let old = json!({ "number": 0, "secret": first["secret"] });
    for key in [&guessed, &old] {
        let (status, problem) = hall.command(&hall.operator, "press", key, "modifyGSPD 5").await;
        assert_eq!((status, &problem["code"]), (409, &json!("no_lease")));
    }
    let (status, _) = hall.call(&hall.operator, "DELETE", LEASE, Some(&json!({ "lease": guessed }))).await;
    assert_eq!(status, 409);
    let (status, _) = hall.call(&hall.operator, "DELETE", LEASE, Some(&json!({ "lease": first }))).await;
    assert_eq!(status, 204);
    let second = hall.lease(&hall.admin, "press").await;
    assert!(second["number"].as_u64() > first["number"].as_u64());
    let (status, _) = hall.command(&hall.operator, "press", &first, "modifyGSPD 5").await;
    assert_eq!(status, 409, "the old lease is dead");
}

#[tokio::test]
async fn a_lease_ends_unless_it_is_renewed() {
    let hall = Hall::start().await;
    let (status, lease) = hall.post(&hall.operator, LEASE, &json!({ "duration_ms": 2000 })).await;
    assert_eq!(status, 200, "{lease}");
    let key = &lease["lease"];
    let renew = json!({ "duration_ms": 3000, "renew": key });
    let (status, renewed) = hall.post(&hall.operator, LEASE, &renew).await;
    assert_eq!((status, &renewed["lease"]), (200, key));
    assert!(renewed["expires_in_ms"].as_u64().unwrap() > 2000);
    hall.until_audited(|entry| entry["what"] == "lease_ended" && entry["cause"] == "expired").await;
    let (status, _) = hall.post(&hall.operator, LEASE, &renew).await;
    assert_eq!(status, 409);
    let mut log = hall.robots[0].handle().log();
    let (status, problem) = hall.command(&hall.operator, "press", key, "modifyGSPD 5").await;
    assert_eq!((status, &problem["code"]), (409, &json!("no_lease")));
    assert!(commands(&mut log).is_empty());
    for wrong in [1999, 300_001] {
        let (status, problem) = hall.post(&hall.operator, LEASE, &json!({ "duration_ms": wrong })).await;
        assert_eq!((status, &problem["code"]), (422, &json!("bad_value")));
    }
}

#[tokio::test]
async fn an_admin_takes_the_lease_with_a_reason_and_the_robot_is_stopped_first() {
    let hall = Hall::start().await;
    let first = hall.lease(&hall.operator, "press").await;
    let take = json!({ "take_because": "the shift has ended" });
    let (status, problem) = hall.post(&hall.engineer, LEASE, &take).await;
    assert_eq!((status, &problem["code"]), (403, &json!("not_allowed")));
    let (status, _) = hall.post(&hall.admin, LEASE, &json!({ "take_because": "" })).await;
    assert_eq!(status, 422);
    let mut log = hall.robots[0].handle().log();
    let (status, taken) = hall.post(&hall.admin, LEASE, &take).await;
    assert_eq!((status, &taken["stopped"]), (200, &json!(true)), "{taken}");
    assert!(commands(&mut log).contains(&"actionStop".to_owned()));
    assert!(taken["lease"]["number"].as_u64() > first["number"].as_u64());
    let (status, _) = hall.command(&hall.operator, "press", &first, "modifyGSPD 5").await;
    assert_eq!(status, 409);
    hall.until_audited(|entry| entry["taken_because"] == "the shift has ended").await;
    hall.until_audited(|entry| entry["cause"] == "taken").await;
}

#[tokio::test]
async fn a_new_start_of_the_gateway_ends_all_leases_and_keeps_numbers_and_stops() {
    let mut hall = Hall::start().await;
    let lease = hall.lease(&hall.operator, "press").await;
    assert_eq!(hall.stop(&hall.operator, "press").await.0, 200);
    let robots = std::mem::take(&mut hall.robots);
    let config = RobotConfig::new(name("press"), robots[0].address().to_string());
    let hall = hall.again(vec![config], robots).await;
    let state = hall.until_up("press").await;
    assert_eq!((&state["lease"], &state["stopped"]), (&json!(null), &json!(true)));
    let (status, _) = hall.command(&hall.operator, "press", &lease, "modifyGSPD 5").await;
    assert_eq!(status, 409);
    let next = hall.lease(&hall.operator, "press").await;
    assert!(next["number"].as_u64() > lease["number"].as_u64());
    let audit = hall.audit().await;
    let kinds: Vec<_> = audit.iter().map(|entry| entry["what"].as_str().unwrap()).collect();
    let ended = kinds.iter().position(|what| *what == "gateway_ended").unwrap();
    assert_eq!(kinds[ended + 1], "gateway_started", "{kinds:?}");
    assert!(r6_gateway::verify(hall.data.path(), &[], None).is_ok());
}

#[tokio::test]
async fn the_audit_log_has_the_order_in_which_things_happened() {
    let hall = Hall::start().await;
    for _ in 0..5 {
        let lease = hall.lease(&hall.operator, "press").await;
        hall.command(&hall.operator, "press", &lease, "modifyGSPD 5").await;
        let (status, _) = hall.call(&hall.operator, "DELETE", LEASE, Some(&json!({ "lease": lease }))).await;
        assert_eq!(status, 204);
    }
    // The end of a lease waits to be written, and the beginning of the next one does not overtake it.
    hall.lease(&hall.operator, "press").await;
    let audit = hall.audit().await;
    let of_press = audit.iter().filter(|entry| entry["robot"] == "press");
    let kinds: Vec<_> = of_press.map(|entry| entry["what"].as_str().unwrap()).collect();
    let mut wanted = ["lease_began", "command_intent", "command_outcome", "lease_ended"].repeat(5);
    wanted.push("lease_began");
    assert_eq!(kinds, wanted);
}

#[tokio::test]
async fn the_audit_log_tells_who_gave_a_lease_back() {
    let hall = Hall::start().await;
    let lease = hall.lease(&hall.operator, "press").await;
    // A wrong secret gives nothing back, and is not named.
    let wrong = json!({ "lease": { "number": lease["number"], "secret": "0".repeat(32) } });
    assert_eq!(hall.call(&hall.admin, "DELETE", LEASE, Some(&wrong)).await.0, 409);
    // Another token that has the secret.
    let (status, _) = hall.call(&hall.engineer, "DELETE", LEASE, Some(&json!({ "lease": lease }))).await;
    assert_eq!(status, 204);
    let ended = hall.until_audited(|entry| entry["what"] == "lease_ended").await;
    assert_eq!(
        (&ended["actor"], &ended["holder"]),
        (&json!("token 3 (engineer)"), &json!("token 2 (operator)"))
    );
    assert!(ended["source"].as_str().unwrap().starts_with("127.0.0.1:"), "{ended}");
    // The gateway ends the next one by itself.
    let (status, lease) = hall.post(&hall.operator, LEASE, &json!({ "duration_ms": 2000 })).await;
    assert_eq!(status, 200, "{lease}");
    let is_expired = |entry: &serde_json::Value| entry["cause"] == "expired";
    let ended = hall.until_audited(is_expired).await;
    assert_eq!((&ended["actor"], &ended["source"]), (&json!("gateway"), &json!(null)), "{ended}");
}
