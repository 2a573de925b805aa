//! The end of a run at a station: what is kept of it while the disk fails, and what stays after a fault.

use super::*;
use crate::core::name::RobotName;
use crate::core::seat::{Ask, Secret};
use crate::fleet::config::RobotConfig;
use crate::fleet::roads::Roads;
use crate::fleet::station::{Kept, Shared, Term};
use crate::live::news::{Reading, Told};
use crate::store::{Keeper, Sqlite, Store};

/// A station whose run is under way, and its store.
struct Scene {
    folder: tempfile::TempDir,
    station: Arc<Station>,
    ticket: Ticket,
    run: Run,
}

impl Scene {
    async fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let keeper = Keeper::start(Sqlite::open(folder.path()).unwrap()).unwrap();
        let name = RobotName::new("press").unwrap();
        let term = Term::alone(keeper.clone());
        let shared = Arc::new(Shared::new(keeper, Roads::Tcp, None, 0));
        let station =
            Arc::new(Station::new(RobotConfig::new(name, "10.0.0.1"), Kept::default(), term, shared));
        let ask = Ask { holder: "anna".to_owned(), lasts: Duration::from_secs(60), secret: Secret([1; 16]) };
        let (key, ticket) = station.seat(|seat, now| {
            seat.observed(now, 1, false);
            let key = seat.acquire(now, ask).unwrap().key;
            (key, seat.begin_run(now, key).unwrap())
        });
        let run = Run {
            run_id: 0,
            robot: "press".to_owned(),
            state: RunState::Running,
            program: None,
            version: None,
            sha256: "00".repeat(32),
            repeat: 1,
            steps: 7,
            accepted: 5,
            done: 0,
            lease: key.number,
            by: "anna".to_owned(),
            began_at: clock::time_of_day(),
            ended_at: None,
            because: None,
            stopped_by: None,
            proof: None,
            detail: String::new(),
        };
        let new = NewRun {
            caller: "anna".to_owned(),
            key: "one".to_owned(),
            hash: [7; 32],
            robot: station.robot_name().clone(),
            now: clock::seconds(),
            run: run.clone(),
            by: Author { time: clock::time_of_day(), actor: "anna".to_owned(), source: None },
        };
        let Begun::New(run_id) = station.term.keeper.begin_run(new).await.unwrap() else { panic!() };
        station.runs.send_replace(Some(Run { run_id, ..run.clone() }));
        Self { folder, station, ticket, run: Run { run_id, ..run } }
    }

    fn by() -> By {
        By { actor: "anna".to_owned(), source: None }
    }

    /// What the store has, as the next start reads it.
    fn store(&self) -> Sqlite {
        Sqlite::open(self.folder.path()).unwrap()
    }

    /// The end of the run.
    fn last(&self, owed: bool) -> LastWrite {
        let (run, record) = killed(self.run.clone());
        LastWrite { run, answer: None, owed, record }
    }

    /// How many records of this kind the audit log has.
    fn records(&self, what: &str) -> usize {
        let what = format!("\"what\":\"{what}\"");
        let entries = self.store().entries(0, 100).unwrap();
        entries.iter().filter(|entry| entry.body.contains(&what)).count()
    }
}

#[tokio::test]
async fn a_stop_that_was_not_proved_is_owed_until_it_is_kept_that_a_stop_holds() {
    for (left, owed) in [(Left::NotStopped, false), (Left::OutOfReach, true)] {
        let scene = Scene::new().await;
        let station = &scene.station;
        station.seat(|seat, _| seat.leave(scene.ticket, left));
        let other = rusqlite::Connection::open(scene.folder.path().join("control.db")).unwrap();
        let full = "CREATE TRIGGER full BEFORE INSERT ON seat BEGIN SELECT RAISE(ABORT, 'full'); END";
        other.execute_batch(full).unwrap();
        Arc::clone(station).keep_end(scene.last(true)).await;
        // A start after a kill makes that stop.
        let name = station.robot_name().clone();
        assert_eq!(scene.store().owed_stops().unwrap(), std::slice::from_ref(&name));
        other.execute_batch("DROP TRIGGER full").unwrap();
        station.forget_owed().await;
        assert_eq!(!scene.store().owed_stops().unwrap().is_empty(), owed, "{left:?}");
        assert_eq!(scene.store().seat(&name).unwrap().stopped, !owed);
        if owed {
            let mut told = Reading::from_now(&station.shared.news);
            station.seat(|seat, _| seat.owed_stop_made(false));
            let event = told.next(&station.shared.news);
            let holds = matches!(&event, Some(Told::Event(event)) if matches!(event.happened, Happened::StopBegan { holds: true, .. }));
            assert!(holds, "no caller made this stop, and readers are told of it: {event:?}");
            station.forget_owed().await;
            assert!(scene.store().owed_stops().unwrap().is_empty());
            assert!(scene.store().seat(&name).unwrap().stopped);
        }
    }
}

#[tokio::test]
async fn a_fault_leaves_the_robot_free_with_a_stop_that_is_owed() {
    let scene = Scene::new().await;
    let (station, ticket) = (Arc::clone(&scene.station), scene.ticket);
    let taken = Taken { station: Arc::clone(&station), ticket, left: Left::OutOfReach };
    let task = tokio::spawn(async move {
        let _taken = taken;
        panic!("a fault, as the test wants it");
    });
    assert!(task.await.unwrap_err().is_panic());
    assert!(station.seat(|seat, _| seat.owes_stop() && !seat.has_run()));
    let run = station.run_of(scene.run.run_id).await.unwrap().unwrap();
    assert_eq!((run.state, run.because), (RunState::Unknown, Some(RunEnd::OutcomeUnknown)));
    let begun = Instant::now();
    while scene.records("run_outcome") == 0 {
        assert!(begun.elapsed() < Duration::from_secs(10));
        tokio::time::sleep(FINISH_LOOK).await;
    }
    // After the end of a run nothing more comes.
    drop(Taken { station: Arc::clone(&station), ticket, left: Left::OutOfReach });
    assert_eq!(scene.records("run_outcome"), 1);
}

#[tokio::test]
async fn the_end_of_a_run_is_kept_once_the_disk_takes_it() {
    let scene = Scene::new().await;
    // As if the disk were full.
    let other = rusqlite::Connection::open(scene.folder.path().join("control.db")).unwrap();
    other
        .execute_batch("CREATE TRIGGER full BEFORE INSERT ON audit BEGIN SELECT RAISE(ABORT, 'full'); END")
        .unwrap();
    scene.station.note(&Scene::by(), Deed::StopCleared { lease: 1 });
    let kept = tokio::spawn(Arc::clone(&scene.station).keep_end(scene.last(false)));
    tokio::time::sleep(WRITE_AGAIN / 2).await;
    assert!(!kept.is_finished());
    other.execute_batch("DROP TRIGGER full").unwrap();
    kept.await.unwrap();
    assert_eq!((scene.records("stop_cleared"), scene.records("run_outcome")), (1, 1));
    assert!(scene.store().open_runs().unwrap().is_empty());
    assert!(scene.store().owed_stops().unwrap().is_empty());
}
