//! `r6 -g URL alarms`, `history`, `audit` and `whoami`.

use serde_json::{Value, json};

use crate::by_gateway::{Hall, code};
use crate::gateway_calls::until;
use crate::support::{Outcome, Robot, TempFile, r6};
use crate::told_by_gateway::{Answer, Fake, problem};

/// Each line of stdout as JSON.
fn lines(outcome: &Outcome) -> Vec<Value> {
    outcome.out.lines().map(|line| serde_json::from_str(line).unwrap_or_else(|_| panic!("{line}"))).collect()
}

#[test]
fn alarms_are_listed_and_acknowledged() {
    let scenario = TempFile::new("alarms.toml", "[[at]]\ntime = 0.1\ndo = \"alarm\"\nnumber = 5001\n");
    let robot = Robot::start(&["--scenario", scenario.path()]);
    let named = format!("press={}", robot.address());
    let hall = Hall::start("alarms", &[&named, "saw=127.0.0.1:1"], "operator", &["-v"]);
    let alarms = |args: &[&str]| hall.r6(&[&["alarms", "--json"], args].concat()).json()["alarms"].clone();
    let id = until(|| alarms(&["--active"])[0]["id"].as_u64());

    let all = hall.r6(&["alarms"]);
    assert_eq!(all.code, 0, "{all:?}");
    assert!(all.out.starts_with("ROBOT  CODE  ALARM "), "{}", all.out);
    let line = all.out.lines().nth(1).unwrap();
    assert!(line.starts_with("press  5001  user alarm of the program  THERE  20"), "{line}");
    assert!(line.ends_with(&format!("  -             {id}")), "{line}");
    let saw = hall.r6(&["-r", "saw", "alarms"]);
    assert_eq!(
        (saw.code, saw.out.as_str()),
        (0, "no alarm is there, and none ended within a day\n"),
        "{saw:?}"
    );

    // People write the code in place of the number.
    let by_code = hall.r6(&["-r", "press", "alarms", "--acknowledge", "5001", "--json"]);
    assert_eq!((by_code.code, code(&by_code)), (2, "no_such_alarm".into()), "{by_code:?}");
    assert!(by_code.err.contains(&format!("alarms --acknowledge {id}`")), "{}", by_code.err);
    let nameless = hall.r6(&["alarms", "--acknowledge", &id.to_string()]);
    assert!(nameless.code == 2 && nameless.err.contains("name one with --robot"), "{nameless:?}");
    let id = id.to_string();
    let ask = ["-r", "press", "alarms", "--acknowledge", &id, "--comment", "guard door"];
    let viewer = hall.r6_as("viewer", &[&ask[..], &["--json"]].concat());
    assert_eq!((viewer.code, code(&viewer)), (1, "not_allowed".into()), "{viewer:?}");
    let seen = hall.r6(&ask);
    assert_eq!(seen.code, 0, "{seen:?}");
    assert!(
        seen.out.starts_with("press: alarm 5001 (user alarm of the program) is acknowledged: token ")
            && seen.out.ends_with(", guard door\n"),
        "{}",
        seen.out
    );
    assert_eq!(alarms(&[])[0]["acknowledged"]["comment"], "guard door");
    let again = hall.r6(&["-r", "press", "alarms", "--acknowledge", &id, "--json"]);
    assert_eq!(again.json()["acknowledged"]["comment"], "guard door", "the first one stays");
}

#[test]
fn alarms_that_are_not_known_are_told_and_end_with_3() {
    let fake = Fake::start("alarms", |_| {
        Answer::With(200, json!({ "alarms": [], "left_out": 0, "not_known": ["press-2", "saw"] }))
    });
    let told = r6(&fake.args(&["alarms", "--active", "--json"]));
    let (problem, robots) = (&told.json()["problem"], &told.json()["not_known"]);
    assert_eq!(
        (told.code, &problem["code"], &problem["exit"]),
        (3, &"no_owner".into(), &3.into()),
        "{told:?}"
    );
    assert_eq!(robots, &json!(["press-2", "saw"]));
    assert!(told.err.starts_with("r6: the alarms of press-2, saw are not known now"), "{}", told.err);
    assert_eq!(fake.asked(), ["GET /v1/alarms?active=true&limit=1000"]);
}

#[test]
fn the_history_of_a_value_is_a_table_csv_or_json() {
    let robot = Robot::start(&[]);
    let hall = Hall::start("history", &[&format!("press={}", robot.address())], "viewer", &[]);
    let json = |args: &[&str]| lines(&hall.r6(&[&["history", "curMode", "--json"], args].concat()));
    let page = until(|| {
        let page = json(&["--last", "10m"]).remove(0);
        page["samples"].as_array().is_some_and(|samples| !samples.is_empty()).then_some(page)
    });
    assert_eq!((&page["robot"], &page["signal"]), (&"press".into(), &"curMode".into()));
    assert_eq!(page["samples"][0]["value"], 7);

    let table = hall.r6(&["history", "curMode"]);
    assert_eq!(table.code, 0, "{table:?}");
    let rows: Vec<_> = table.out.lines().collect();
    assert!(rows[0].starts_with("TIME ") && rows[0].ends_with("  VALUE"), "{}", table.out);
    assert!(rows[1].starts_with("20") && rows[1].ends_with("  running (7)"), "{}", table.out);
    let csv = hall.r6(&["-r", "press", "history", "curMode", "--csv"]);
    assert!(csv.out.starts_with("time,value,gap\r\n20") && csv.out.contains("Z,7,\r\n"), "{}", csv.out);
    let buckets = json(&["--bucket", "1m"]);
    assert_eq!(buckets[0]["bucket_ms"], 60_000);
    let buckets = hall.r6(&["history", "curMode", "--bucket", "1m"]);
    assert!(
        buckets.out.starts_with("TIME ") && buckets.out.contains("  GOOD MS  SAMPLES\n"),
        "{}",
        buckets.out
    );

    let old =
        hall.r6(&["history", "curMode", "--from", "2001-01-01T00:00:00Z", "--to", "2001-01-01T01:00:00Z"]);
    let told = "no value of curMode was kept from 2001-01-01T00:00:00Z to 2001-01-01T01:00:00Z\n";
    assert_eq!((old.code, old.out.as_str(), old.err.as_str()), (0, told, ""), "it is read: {old:?}");
    // What is not read is not kept either.
    for form in [&[][..], &["--bucket", "1m"], &["--csv"], &["--json"]] {
        let unread = hall.r6(&[&["history", "axis-7"], form].concat());
        assert_eq!(unread.code, 0, "{unread:?}");
        let told = "r6: the gateway does not read axis-7 of press, so it keeps no value of it; nearest that are read: axis-5, \
                    axis-4, axis-3\n";
        assert!(unread.err.starts_with(told), "{form:?}: {}", unread.err);
        assert!(unread.err.contains(" query axis-7` asks the robot now"), "{form:?}: {}", unread.err);
    }
    for (args, told) in [
        (&["history", "curMod"][..], "nearest: `curMold`"),
        (&["history", "curMode", "--from", "today"], "write a time in UTC"),
        (&["history", "curMode", "--last", "8"], "write a length of time"),
        (&["history", "curMode", "--bucket", "wide"], "is not a width such as 10s or 1m"),
        (&["history", "curMode", "--csv", "--json"], "cannot be used with"),
    ] {
        let wrong = hall.r6(args);
        assert_eq!(wrong.code, 2, "{args:?}: {wrong:?}");
        assert!(wrong.err.contains(told), "{args:?}: {}", wrong.err);
    }
}

/// A page of a history.
fn page(time: &str, unreadable: u64, cursor: Option<&str>) -> Answer {
    let page = json!({
        "robot": "press-1", "signal": "axis-0", "unit": null, "from": "2026-11-25T06:00:00Z", "to": "2026-11-25T07:00:00Z",
        "samples": [{ "time": time, "value": 1.5 }, { "time": time, "value": null, "gap": "stale" }],
        "kept_until": null, "unreadable_chunks": unreadable, "next_cursor": cursor,
    });
    Answer::With(200, page)
}

#[test]
fn a_history_of_several_pages_is_read_to_its_end() {
    let fake = Fake::start("pages", |what| match what.split("cursor=").nth(1) {
        None => page("2026-11-25T06:10:00Z", 0, Some("t7")),
        Some("t7") => page("2026-11-25T06:20:00Z", 2, None),
        Some(_) => problem(422, "bad_value"),
    });
    let csv = fake.r6(&["history", "axis-0", "--last", "1h", "--csv"]);
    let wanted = "time,value,gap\r\n2026-11-25T06:10:00Z,1.5,\r\n2026-11-25T06:10:00Z,,stale\r\n\
                  2026-11-25T06:20:00Z,1.5,\r\n2026-11-25T06:20:00Z,,stale\r\n";
    assert_eq!((csv.code, csv.out.as_str()), (1, wanted), "{csv:?}");
    assert!(csv.err.contains("values are missing: the gateway cannot read 2 parts"), "{}", csv.err);
    let asked = fake.asked();
    assert!(
        asked[0].starts_with("GET /v1/robots/press-1/history?signal=axis-0&limit=2000&from=20"),
        "{asked:?}"
    );
    let range = "from=2026-11-25T06%3A00%3A00Z&to=2026-11-25T07%3A00%3A00Z&cursor=t7";
    assert!(asked[1].ends_with(range), "the range of the first page stays: {asked:?}");

    let json = lines(&fake.r6(&["history", "axis-0", "--json"]));
    assert_eq!((&json[0]["problem"], &json[1]["problem"]["code"]), (&Value::Null, &"no_value".into()));
    let table = fake.r6(&["history", "axis-0"]);
    assert_eq!(table.code, 0, "its page is whole: {table:?}");
    assert!(table.out.ends_with("  - (stale)\n") && table.err.contains("more follow"), "{table:?}");

    let circle = Fake::start("circle", |_| page("2026-11-25T06:10:00Z", 0, Some("t7")));
    let circle = circle.r6(&["history", "axis-0", "--csv"]);
    assert!(circle.code == 3 && circle.err.contains("leads back to itself"), "{circle:?}");
}

#[test]
fn a_history_of_which_averages_are_left_says_so_in_each_form() {
    let day = ["2026-09-01T00:00:00Z", "2026-09-02T00:00:00Z"];
    let part = json!({ "from": day[0], "to": day[1], "width_ms": 60_000, "used": "not_used" });
    let fake = Fake::start("averages", move |_| {
        let page = json!({
            "robot": "press-1", "signal": "axis-0", "unit": null, "from": day[0], "to": day[1], "samples": [],
            "kept_until": null, "unreadable_chunks": 0, "averages": [part], "next_cursor": null,
        });
        Answer::With(200, page)
    });
    let asked = ["history", "axis-0", "--from", day[0], "--to", day[1]];
    for (form, out) in [
        (&[][..], "no value of axis-0 is left from 2026-09-01T00:00:00Z to 2026-09-02T00:00:00Z\n"),
        (&["--csv"], "time,value,gap\r\n"),
    ] {
        let told = fake.r6(&[&asked[..], form].concat());
        assert_eq!((told.code, told.out.as_str()), (0, out), "{told:?}");
        assert!(told.err.contains("averages of 1m are left: ask with `--bucket 1m`"), "{}", told.err);
    }
    let json = fake.r6(&[&asked[..], &["--json"]].concat());
    assert_eq!(json.json()["averages"][0]["used"], "not_used");
}

#[test]
fn the_audit_log_is_shown_to_engineers() {
    let robots = [Robot::start(&[]), Robot::start(&[])];
    let names = [format!("press={}", robots[0].address()), format!("saw={}", robots[1].address())];
    let hall = Hall::start("audit", &[&names[0], &names[1]], "engineer", &[]);
    assert_eq!(hall.r6(&["-r", "press", "command", "modifyGSPD", "5"]).code, 0);
    assert_eq!(hall.r6(&["-r", "saw", "command", "modifyGSPD", "6"]).code, 0);

    let all = lines(&hall.r6(&["audit", "--after", "0", "--json"]));
    let numbers: Vec<_> = all.iter().map(|entry| entry["number"].as_u64().unwrap()).collect();
    assert!(numbers.len() > 6 && numbers.iter().zip(1..).all(|(number, at)| *number == at), "{numbers:?}");
    assert!(all.iter().all(|entry| entry["hash"].is_string()));
    let last = lines(&hall.r6(&["audit", "--last", "2", "--json"]));
    assert_eq!(last[..], all[all.len() - 2..]);

    let table = hall.r6(&["-r", "press", "audit"]);
    assert_eq!(table.code, 0, "{table:?}");
    assert!(table.out.starts_with("NUMBER  TIME "), "{}", table.out);
    assert!(table.out.contains("  command_intent  "), "{}", table.out);
    assert!(table.out.contains("modifyGSPD") && !table.out.contains(" saw "), "{}", table.out);
    let none = hall.r6(&["audit", "--after", "1000000"]);
    assert_eq!((none.code, none.out.as_str()), (0, ""), "{none:?}");
    assert!(none.err.contains("no entry behind 1000000 is there"), "{}", none.err);
    let few = hall.r6(&["-r", "no-such", "audit", "--last", "2"]);
    assert!(few.err.contains("may read none of the last 2 entries about no-such"), "{}", few.err);

    let operator = hall.r6_as("operator", &["audit", "--json"]);
    assert_eq!((operator.code, code(&operator)), (1, "not_allowed".into()), "{operator:?}");
    let circle = Fake::start("audit", |_| Answer::With(200, json!({ "entries": [], "next_after": 7 })));
    let circle = r6(&circle.args(&["audit", "--after", "7"]));
    assert!(circle.code == 3 && circle.err.contains("leads back to itself"), "{circle:?}");
}

#[test]
fn a_token_is_told_who_it_is_and_for_which_robots() {
    let hall = Hall::start("whoami", &["press=127.0.0.1:1", "saw=127.0.0.1:2"], "viewer", &["-v"]);
    let anonymous = hall.r6(&["whoami"]);
    assert_eq!(anonymous.code, 0, "{anonymous:?}");
    assert_eq!(anonymous.out, "token 1\nROBOT       ROLE\nall robots  viewer\n");

    let made = ["gateway", "token", "--data", &hall.data, "--role", "engineer", "--name", "line 2"];
    let made = r6(&[&["-r", "press,saw=operator"], &made[..]].concat());
    let file = TempFile::new("whoami-line-2", made.out.trim());
    let ask = |args: &[&str]| r6(&[&["-g", &hall.url, "--token-file", file.path()], args].concat());
    let named = ask(&["whoami"]);
    assert_eq!(named.out, "token 2 (line 2)\nROBOT  ROLE\npress  engineer\nsaw    operator\n", "{named:?}");
    let saw = ask(&["-r", "saw", "whoami", "--json"]).json();
    assert_eq!(
        (&saw["token"], &saw["token_name"], &saw["user"], &saw["role"], &saw["robot"]),
        (&2.into(), &"line 2".into(), &Value::Null, &"engineer".into(), &"press,saw=operator".into())
    );
    assert_eq!(saw["robots"], json!([{ "robot": "saw", "role": "operator" }]));
    assert!(saw.get("csrf").is_none(), "{saw}");
    let mill = ask(&["-r", "mill", "whoami"]);
    assert_eq!((mill.code, mill.out.as_str()), (0, "token 2 (line 2)\nROBOT  ROLE\nmill   none\n"));

    // What a token may not do says where to look.
    let refused = ask(&["-r", "mill", "alarms"]);
    assert_eq!(refused.code, 1, "{refused:?}");
    assert!(refused.err.contains(&format!("`r6 --robot mill --gateway-url {}", hall.url)), "{}", refused.err);
    assert!(refused.err.contains(" whoami` says what this token may do"), "{}", refused.err);
    let unknown = Fake::start("whoami", |_| problem(401, "no_token"));
    let unknown = unknown.r6(&["whoami", "--json"]);
    assert_eq!((unknown.code, code(&unknown)), (2, "no_token".into()), "{unknown:?}");
}

#[test]
fn what_only_a_gateway_knows_needs_its_url() {
    let commands =
        [&["alarms"][..], &["history", "axis-0"], &["audit"], &["whoami"], &["-r", "press", "alarms"]];
    for args in commands {
        let none = r6(args);
        assert_eq!(none.code, 2, "{args:?}: {none:?}");
        assert!(none.err.contains("asks a gateway, and none is named"), "{}", none.err);
    }
}
