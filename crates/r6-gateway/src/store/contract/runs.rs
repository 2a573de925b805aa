//! Runs of programs.

use super::*;

fn new_run(caller: &str, key: &str, now: u64) -> NewRun {
    let run = Run {
        run_id: 0,
        robot: "press".to_owned(),
        state: RunState::Running,
        program: Some("pick".to_owned()),
        version: Some(2),
        sha256: "00".repeat(32),
        repeat: 1,
        steps: 7,
        accepted: 0,
        done: 0,
        lease: 3,
        by: "anna".to_owned(),
        began_at: "2026-01-01T00:00:00.000000Z".to_owned(),
        ended_at: None,
        because: None,
        stopped_by: None,
        proof: None,
        detail: String::new(),
    };
    let robot = RobotName::new("press").unwrap();
    let (caller, key) = (caller.to_owned(), key.to_owned());
    NewRun { caller, key, hash: [7; 32], robot, now, run, by: author() }
}

fn begin(store: &mut dyn Store, new: &NewRun) -> u64 {
    match store.begin_run(new).unwrap() {
        Begun::New(number) => number,
        other => panic!("{other:?}"),
    }
}

fn ended(mut run: Run) -> (Run, AuditRecord) {
    (run.state, run.because, run.done) = (RunState::Done, Some(RunEnd::Finished), run.steps);
    let deed = Deed::RunOutcome {
        run: run.run_id,
        state: run.state,
        because: RunEnd::Finished,
        done: run.done,
        detail: String::new(),
    };
    (run, record(deed))
}

#[test]
fn a_key_runs_a_program_once_and_the_audit_log_has_intent_and_outcome() {
    on_each(|store| {
        let press = RobotName::new("press").unwrap();
        let new = new_run("token 1", "a", 1_000);
        let number = begin(store, &new);
        let open = KeptRun {
            hash: [7; 32],
            run: Run { run_id: number, ..new.run.clone() },
            answer: None,
            ended: false,
        };
        assert_eq!(store.begin_run(&new).unwrap(), Begun::Known(Box::new(open.clone())));
        assert_eq!(store.run_of_key("token 1", "a", 0).unwrap(), Some(open.clone()));
        assert_eq!(store.run_of_key("token 2", "a", 0).unwrap(), None, "each caller has its own keys");
        assert_eq!(store.run(&press, number).unwrap(), Some(open.clone()));
        assert_eq!(store.run(&RobotName::new("saw").unwrap(), number).unwrap(), None);
        assert_eq!(store.run(&press, u64::MAX).unwrap(), None);
        assert_eq!(store.open_runs().unwrap(), std::slice::from_ref(&open.run));
        assert_eq!(store.owed_stops().unwrap(), std::slice::from_ref(&press));

        store.answer_run(number, "{}").unwrap();
        let (run, record) = ended(open.run.clone());
        store.end_run(&run, false, &[record]).unwrap();
        let done = KeptRun { run, answer: Some("{}".to_owned()), ended: true, ..open };
        assert_eq!(store.run(&press, number).unwrap(), Some(done));
        assert!(store.open_runs().unwrap().is_empty() && store.owed_stops().unwrap().is_empty());

        let second = begin(store, &new_run("token 2", "a", 1_000));
        assert!(number < second);
        let entries = store.entries(0, 100).unwrap();
        let kinds: Vec<_> = entries.iter().map(|entry| what(&entry.body)).collect();
        assert_eq!(kinds, ["run_intent", "run_outcome", "run_intent"]);
        assert!(entries[0].body.contains(&format!("\"run\":{number}")), "{}", entries[0].body);
        assert!(head(store).is_ok());
    });
}

fn what(body: &str) -> String {
    let body: serde_json::Value = serde_json::from_str(body).unwrap();
    body["what"].as_str().unwrap().to_owned()
}

#[test]
fn runs_go_after_a_day_but_not_while_they_are_open_or_a_stop_is_owed() {
    on_each(|store| {
        let press = RobotName::new("press").unwrap();
        let numbers = ["done", "owed", "open"].map(|key| begin(store, &new_run("token 1", key, 1_000)));
        for (number, owed) in [(numbers[0], false), (numbers[1], true)] {
            let (run, record) = ended(store.run(&press, number).unwrap().unwrap().run);
            store.end_run(&run, owed, &[record]).unwrap();
        }
        let since = 1_001;
        assert_eq!(store.run_of_key("token 1", "done", since).unwrap(), None, "it is too old");
        assert!(store.run_of_key("token 1", "owed", since).unwrap().is_some());
        assert!(store.run_of_key("token 1", "open", since).unwrap().is_some());
        begin(store, &new_run("token 1", "edge", 1_000 + KEPT));
        assert!(store.run(&press, numbers[0]).unwrap().is_some(), "a day is not over");
        begin(store, &new_run("token 1", "later", 1_001 + KEPT));
        assert_eq!(store.run(&press, numbers[0]).unwrap(), None);
        assert!(store.run(&press, numbers[1]).unwrap().is_some());
        // The same key is a new one now, and its run gets a new number.
        let again = begin(store, &new_run("token 1", "done", 1_001 + KEPT));
        assert!(numbers[2] < again);

        assert_eq!(store.owed_stops().unwrap(), std::slice::from_ref(&press));
        store.forget_owed_stop(&press).unwrap();
        assert_eq!(store.owed_stops().unwrap(), std::slice::from_ref(&press), "open runs still owe it");
        for run in store.open_runs().unwrap() {
            let (run, record) = ended(run);
            store.end_run(&run, true, &[record]).unwrap();
        }
        store.forget_owed_stop(&press).unwrap();
        assert!(store.owed_stops().unwrap().is_empty());
    });
}

#[test]
fn the_runs_of_a_robot_are_listed_newest_first_in_pages() {
    on_each(|store| {
        let (press, saw) = (RobotName::new("press").unwrap(), RobotName::new("saw").unwrap());
        let mut numbers = Vec::new();
        for key in ["a", "b", "c", "d"] {
            numbers.push(begin(store, &new_run("token 1", key, 1_000)));
            let other = NewRun { robot: saw.clone(), ..new_run("token 1", &format!("saw {key}"), 1_000) };
            begin(store, &other);
        }
        let (run, record) = ended(store.run(&press, numbers[1]).unwrap().unwrap().run);
        store.end_run(&run, false, &[record]).unwrap();
        let mut page = |before, most| store.runs(&press, before, most).unwrap();
        let of = |runs: &[Run]| runs.iter().map(|run| (run.run_id, run.state)).collect::<Vec<_>>();
        let listed = |place: usize, state| (numbers[place], state);
        let (done, running) = (RunState::Done, RunState::Running);
        assert_eq!(of(&page(u64::MAX, 2)), [listed(3, running), listed(2, running)]);
        assert_eq!(of(&page(numbers[2], 2)), [listed(1, done), listed(0, running)]);
        assert_eq!(of(&page(numbers[0], 2)), []);
        assert_eq!(page(u64::MAX, 1000).len(), 4);
    });
}

#[test]
fn one_robot_leaves_room_for_the_runs_of_the_others() {
    let folder = tempfile::tempdir().unwrap();
    let mut store = Sqlite::open(folder.path()).unwrap();
    drop(store.begin_run(&new_run("anna", "first", 100)).unwrap());
    // As many as there may be, without a turn of the disk for each.
    let raw = rusqlite::Connection::open(folder.path().join("control.db")).unwrap();
    let more = MAX_RUNS_OF_ONE - 1;
    raw.execute_batch(&format!(
        "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n WHERE i < {more})
         INSERT INTO run (robot, caller, key, hash, made, run, ended, owed)
         SELECT 'press', 'anna', 'key ' || i, hash, made, run, 1, 0 FROM n, (SELECT * FROM run LIMIT 1)"
    ))
    .unwrap();
    drop(raw);
    assert_eq!(store.begin_run(&new_run("anna", "last", 100)), Ok(Begun::Full));
    let other = NewRun { robot: RobotName::new("saw").unwrap(), ..new_run("anna", "other", 100) };
    assert!(matches!(store.begin_run(&other), Ok(Begun::New(_))));
}
