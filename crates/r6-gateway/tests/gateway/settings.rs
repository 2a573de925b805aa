//! The settings of the hall.

use r6_api::gateway::{HallSettings, Role, Shift, Weekday};
use r6_gateway::{Gateway, Hall as HallOfFile};
use serde_json::{Value, json};

use crate::support::{Hall, Reply, call, call_with, name, settings};

const SETTINGS: &str = "/v1/settings";

/// Two shifts in Berlin.
pub fn berlin() -> Value {
    json!({ "time_zone": "Europe/Berlin", "shifts": [
        { "name": "early", "days": ["mon", "tue"], "begin": "06:00", "end": "14:00" },
        { "name": "night", "days": ["tue"], "begin": "22:00", "end": "06:00" },
    ] })
}

impl Hall {
    /// Changes the settings from this version on.
    pub async fn put_settings(&self, token: &str, etag: Option<&str>, body: &Value) -> Reply {
        let line = etag.map_or(String::new(), |etag| format!("If-Match: {etag}\r\n"));
        call_with(self.gateway.address(), token, "PUT", SETTINGS, &line, Some(body)).await
    }

    /// Changes the settings as they are.
    pub async fn set(&self, body: &Value) {
        let now = self.get(&self.viewer, SETTINGS).await;
        let told = self.put_settings(&self.admin, now["etag"].as_str(), body).await;
        assert_eq!(told.status, 200, "{}", told.body);
    }
}

#[tokio::test]
async fn a_zone_that_browsers_do_not_know_is_refused_and_one_that_was_stored_does_no_harm() {
    let hall = Hall::start().await;
    let etag = hall.get(&hall.viewer, SETTINGS).await["etag"].as_str().unwrap().to_owned();
    for zone in ["Etc/Unknown", "etc/unknown", "Factory"] {
        let body = json!({ "time_zone": zone, "shifts": [] });
        let refused = hall.put_settings(&hall.admin, Some(&etag), &body).await;
        assert_eq!((refused.status, &refused.body["code"]), (422, &json!("bad_value")), "{zone}");
        assert!(refused.body["message"].as_str().unwrap().contains("time_zone"), "{}", refused.body);
    }
    hall.set(&berlin()).await;
    // As an earlier version of the gateway took it.
    let store = rusqlite::Connection::open(hall.data.path().join("control.db")).unwrap();
    let changed =
        store.execute("UPDATE hall SET settings = replace(settings, 'Europe/Berlin', 'Etc/Unknown')", []);
    assert_eq!(changed.unwrap(), 1);
    drop(store);
    let hall = hall.again(Vec::new(), Vec::new()).await;
    let now = hall.get(&hall.viewer, SETTINGS).await;
    assert_eq!((&now["time_zone"], &now["shifts"]), (&json!("UTC"), &berlin()["shifts"]));
}

#[tokio::test]
async fn settings_are_changed_by_version_audited_and_kept() {
    let hall = Hall::start().await;
    let first = call_with(hall.gateway.address(), &hall.viewer, "GET", SETTINGS, "", None).await;
    assert_eq!((first.status, &first.body["time_zone"]), (200, &json!("UTC")));
    assert_eq!((&first.body["shifts"], &first.body["managed_by"]), (&json!([]), &json!("api")));
    let etag = first.etag.unwrap();
    assert_eq!(first.body["etag"], json!(etag));

    let without = hall.put_settings(&hall.admin, None, &berlin()).await;
    assert_eq!((without.status, &without.body["code"]), (428, &json!("needs_if_match")));
    let made = hall.put_settings(&hall.admin, Some(&etag), &berlin()).await;
    assert_eq!((made.status, &made.body["shifts"]), (200, &berlin()["shifts"]));
    let new = made.etag.unwrap();
    assert_ne!(new, etag);
    let late = hall.put_settings(&hall.admin, Some(&etag), &berlin()).await;
    assert_eq!((late.status, &late.body["code"]), (412, &json!("not_this_version")));

    let only =
        r6_gateway::make_token(hall.data.path(), Role::Admin, Some(name("press").into()), String::new());
    let refused = hall.put_settings(&only.unwrap().1, Some(&new), &berlin()).await;
    assert_eq!((refused.status, &refused.body["code"]), (403, &json!("not_allowed")), "of one robot");

    let audit = hall.audit().await;
    let entries: Vec<_> = audit.iter().filter(|entry| entry["what"] == "settings_changed").collect();
    let [entry] = &entries[..] else { panic!("{entries:#?}") };
    assert_eq!((&entry["time_zone"], &entry["version"]), (&json!("Europe/Berlin"), &json!(1)));
    assert_eq!((&entry["shifts"], &entry["actor"]), (&berlin()["shifts"], &json!("token 4 (admin)")));

    let hall = hall.again(Vec::new(), Vec::new()).await;
    let kept = call_with(hall.gateway.address(), &hall.viewer, "GET", SETTINGS, "", None).await;
    assert_eq!((kept.etag, &kept.body), (Some(new), &made.body));
}

#[tokio::test]
async fn every_mistake_of_settings_is_told_with_its_place() {
    let hall = Hall::start().await;
    let etag = hall.get(&hall.viewer, SETTINGS).await["etag"].as_str().unwrap().to_owned();
    let mut wrong = berlin();
    wrong["time_zone"] = json!("Berlin");
    wrong["shifts"][0]["begin"] = json!("6 am");
    wrong["shifts"][1]["name"] = json!("early");
    let told = hall.put_settings(&hall.admin, Some(&etag), &wrong).await;
    assert_eq!((told.status, &told.body["code"]), (422, &json!("bad_value")));
    let message = told.body["message"].as_str().unwrap();
    for part in
        ["time_zone: `Berlin` is no time zone", "shifts[0].begin: `6 am`", "shifts[1].name: two shifts"]
    {
        assert!(message.contains(part), "{message}");
    }
    for (field, value) in [
        ("shifts", json!([{ "name": "a", "days": ["monday"], "begin": "06:00", "end": "07:00" }])),
        ("shifts", json!([{ "name": "a", "days": ["mon"], "begin": "06:00" }])),
        ("shifts", json!(3)),
        ("time_zone", json!(null)),
        ("zone", json!("UTC")),
    ] {
        let mut body = berlin();
        body[field] = value;
        let told = hall.put_settings(&hall.admin, Some(&etag), &body).await;
        assert_eq!((told.status, &told.body["code"]), (422, &json!("bad_value")), "{body}: {}", told.body);
    }
    assert_eq!(hall.get(&hall.viewer, SETTINGS).await["time_zone"], "UTC", "nothing was changed");
}

#[tokio::test]
async fn settings_of_the_file_are_changed_there() {
    let data = tempfile::tempdir().unwrap();
    let shift = Shift {
        name: "day".to_owned(),
        days: Weekday::ALL.into(),
        begin: "08:00".to_owned(),
        end: "16:00".to_owned(),
    };
    let of = |zone: &str| {
        let settings = HallSettings { time_zone: zone.to_owned(), shifts: vec![shift.clone()] };
        HallOfFile::new(settings).unwrap()
    };
    let settings =
        r6_gateway::GatewaySettings { hall: Some(of("Asia/Shanghai")), ..settings(data.path(), Vec::new()) };
    let gateway = Gateway::start(settings).await.unwrap();
    let admin = r6_gateway::make_token(data.path(), Role::Admin, None, String::new()).unwrap().1;
    let now = async || call_with(gateway.address(), &admin, "GET", SETTINGS, "", None).await;
    let read = now().await;
    assert_eq!(
        (&read.body["managed_by"], &read.body["time_zone"]),
        (&json!("file"), &json!("Asia/Shanghai"))
    );
    let line = format!("If-Match: {}\r\n", read.etag.unwrap());
    let told = call_with(gateway.address(), &admin, "PUT", SETTINGS, &line, Some(&berlin())).await;
    assert_eq!((told.status, &told.body["code"]), (409, &json!("managed_by_file")));
    // The file was read again.
    gateway.set_hall(Some(of("Asia/Tokyo")));
    assert_eq!(now().await.body["time_zone"], "Asia/Tokyo");
    gateway.set_hall(None);
    let read = now().await;
    assert_eq!((&read.body["managed_by"], &read.body["time_zone"]), (&json!("api"), &json!("UTC")));
    assert_eq!(call(gateway.address(), &admin, "GET", SETTINGS, None).await.0, 200);
}
