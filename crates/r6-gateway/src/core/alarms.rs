//! The alarms of one robot as things with a state: active or ended, acknowledged, shelved.
//!
//! A controller tells one code at a time, so a robot has one active alarm at most. An alarm goes on as long
//! as its code is read, also if the robot was not seen in between: that it ended and came again cannot be
//! told then. Everything else is another alarm, which is not acknowledged.
//!
//! To acknowledge or to shelve changes nothing at the robot.

use r6_proto::time::Instant;
use serde::{Deserialize, Serialize};

use super::history::sample::Micros;

/// How many ended alarms of one robot are kept: a page of a screen, and some kilobytes of the store.
pub const MAX_ENDED: usize = 30;

/// For how long an ended alarm is kept, in µs: a day, so that the next shift sees it.
const KEPT_FOR: i64 = 86_400_000_000;

/// How many codes of one robot are shelved at once. More would hide the robot itself. Fewer than
/// [`MAX_ENDED`], so that the last alarm of each shelved code is kept.
pub const MAX_SHELVED: usize = 10;

/// The longest time on the shelf, in ms: 8 hours, so that each shift decides anew.
pub const LONGEST_SHELF_MS: u64 = 8 * 3_600_000;

/// The shortest one, in ms: a second.
pub const SHORTEST_SHELF_MS: u64 = 1_000;

/// The longest comment or reason, in bytes.
pub const MAX_WORDS: usize = 200;

/// How far the clock may be set back before something that was just shelved counts as of the future, in µs.
const CLOCK_TOLERANCE: i64 = 60_000_000;

/// An alarm. The names of the fields stand in files: they never change.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Alarm {
    /// Its number, which no other alarm of this robot ever has: when it was read first, in µs since 1970.
    pub id: u64,
    /// Its code, above 0.
    pub code: u32,
    /// When it was read first.
    pub since: Micros,
    /// Whether its begin was seen: the reading before had another code.
    pub begin_seen: bool,
    /// When it was seen to be gone; `None` while it is active.
    pub until: Option<Micros>,
    /// Whether its end was seen: the reading before still had it. `false` while it is active, and in files
    /// that do not tell.
    #[serde(default)]
    pub end_seen: bool,
    /// Who acknowledged it.
    pub acknowledged: Option<Acknowledged>,
}

/// Who acknowledged an alarm.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Acknowledged {
    /// Who.
    pub by: String,
    /// When.
    pub at: Micros,
    /// What they said.
    pub comment: Option<String>,
}

/// A code that is shelved: its alarms need no answer until then.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Shelf {
    /// The code.
    pub code: u32,
    /// Who shelved it.
    pub by: String,
    /// When.
    pub at: Micros,
    /// Until when.
    pub until: Micros,
    /// Why.
    pub reason: String,
}

impl Shelf {
    /// Whether it holds at this time. A clock that was set back makes it end.
    fn holds(&self, now: Micros) -> bool {
        now < self.until && self.at.0 <= now.0.saturating_add(CLOCK_TOLERANCE)
    }
}

/// What survives the end of the process.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Saved {
    /// The last number that was given out.
    pub last_id: u64,
    /// The alarm that is active, or was when the robot was seen last.
    pub active: Option<Alarm>,
    /// Those that ended, the latest last.
    pub ended: Vec<Alarm>,
    /// The codes that are shelved.
    pub shelves: Vec<Shelf>,
    /// Whether another robot answered since the last reading: nothing goes on.
    #[serde(default)]
    pub is_replaced: bool,
}

/// Why something was not done with an alarm.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Denied {
    /// The robot has no such alarm, or it was forgotten.
    NoSuchAlarm,
    /// There is no room for another code on the shelf.
    TooManyShelved,
}

/// The alarms of one robot.
#[derive(Clone, Debug, Default)]
pub struct Alarms {
    saved: Saved,
    /// When the code was read last.
    read_at: Option<Instant>,
}

impl Alarms {
    /// As they were saved.
    #[must_use]
    pub fn new(saved: Saved) -> Self {
        Self { saved, read_at: None }
    }

    /// What has to survive the end of the process.
    #[must_use]
    pub fn saved(&self) -> &Saved {
        &self.saved
    }

    /// The robot tells this code, 0 for no alarm, as was asked at this moment and time of day. `change_seen`:
    /// whether the reading before had another code, with nothing lost in between. A reading that is older
    /// than the last one says nothing. Returns whether an acknowledged alarm ended: that has to be saved
    /// soon.
    pub fn read(&mut self, at: Instant, time: Micros, code: u32, change_seen: bool) -> bool {
        if self.read_at.is_some_and(|last| at < last) {
            return false;
        }
        self.read_at = Some(at);
        let is_replaced = std::mem::take(&mut self.saved.is_replaced);
        if !is_replaced && self.saved.active.as_ref().map_or(0, |active| active.code) == code {
            return false;
        }
        let ended = self.saved.active.take();
        let was_acknowledged = ended.as_ref().is_some_and(|ended| ended.acknowledged.is_some());
        if let Some(ended) = ended {
            let until = Some(time.max(ended.since));
            self.saved.ended.push(Alarm { until, end_seen: change_seen && !is_replaced, ..ended });
            self.make_room(time);
        }
        if code != 0 {
            let id = u64::try_from(time.0).unwrap_or(0).max(self.saved.last_id.saturating_add(1));
            self.saved.last_id = id;
            let (since, begin_seen) = (time, change_seen && !is_replaced);
            self.saved.active =
                Some(Alarm { id, code, since, begin_seen, until: None, end_seen: false, acknowledged: None });
        }
        was_acknowledged
    }

    /// Another robot answers: the next reading is about another alarm.
    pub fn replace(&mut self) {
        self.saved.is_replaced = true;
    }

    /// Forgets what is too old at this time.
    pub fn forget(&mut self, now: Micros) {
        self.saved.shelves.retain(|shelf| shelf.holds(now));
        self.forget_ended(|alarm| alarm.until.is_some_and(|until| now.0.saturating_sub(until.0) > KEPT_FOR));
    }

    /// The shelf of a code, if it is shelved at this time.
    #[must_use]
    pub fn shelf(&self, code: u32, now: Micros) -> Option<&Shelf> {
        self.saved.shelves.iter().find(|shelf| shelf.code == code && shelf.holds(now))
    }

    /// The alarm with this number.
    #[must_use]
    pub fn alarm(&self, id: u64) -> Option<&Alarm> {
        self.all().find(|alarm| alarm.id == id)
    }

    /// All alarms that are known: the active one first, then those that ended, the latest first.
    pub fn all(&self) -> impl Iterator<Item = &Alarm> {
        self.saved.active.iter().chain(self.saved.ended.iter().rev())
    }

    /// Acknowledges an alarm. Returns whether it was not before: the first to acknowledge it stays.
    ///
    /// # Errors
    /// [`Denied::NoSuchAlarm`].
    pub fn acknowledge(&mut self, id: u64, by: &Acknowledged) -> Result<bool, Denied> {
        let mut all = self.saved.active.iter_mut().chain(&mut self.saved.ended);
        let alarm = all.find(|alarm| alarm.id == id).ok_or(Denied::NoSuchAlarm)?;
        let is_new = alarm.acknowledged.is_none();
        alarm.acknowledged.get_or_insert_with(|| by.clone());
        Ok(is_new)
    }

    /// Shelves a code, or shelves it anew.
    ///
    /// # Errors
    /// [`Denied::TooManyShelved`].
    pub fn shelve(&mut self, shelf: Shelf) -> Result<(), Denied> {
        let others = |other: &&Shelf| other.code != shelf.code && other.holds(shelf.at);
        if self.saved.shelves.iter().filter(others).count() >= MAX_SHELVED {
            return Err(Denied::TooManyShelved);
        }
        self.saved.shelves.retain(|other| other.code != shelf.code && other.holds(shelf.at));
        self.saved.shelves.push(shelf);
        Ok(())
    }

    /// Takes a code from the shelf. Returns whether it was there at this time.
    pub fn unshelve(&mut self, code: u32, now: Micros) -> bool {
        let was_shelved = self.shelf(code, now).is_some();
        self.saved.shelves.retain(|shelf| shelf.code != code);
        was_shelved
    }

    /// Forgets the oldest ended alarms, if there are too many.
    fn make_room(&mut self, now: Micros) {
        self.saved.shelves.retain(|shelf| shelf.holds(now));
        let mut excess = self.saved.ended.len().saturating_sub(MAX_ENDED);
        self.forget_ended(|_| {
            let is_excess = excess > 0;
            excess = excess.saturating_sub(usize::from(is_excess));
            is_excess
        });
    }

    /// Forgets ended alarms that are as `is_too_old` says, the oldest first. The last alarm of a code that is
    /// shelved stays: without it, there would be nothing to unshelve.
    fn forget_ended(&mut self, mut is_too_old: impl FnMut(&Alarm) -> bool) {
        let ended = std::mem::take(&mut self.saved.ended);
        let codes: Vec<_> = ended.iter().map(|alarm| alarm.code).collect();
        let active = self.saved.active.as_ref().map(|active| active.code);
        let is_last = |(number, alarm): (usize, &Alarm)| {
            let is_shelved = self.saved.shelves.iter().any(|shelf| shelf.code == alarm.code);
            let comes_again = codes.get(number + 1..).is_some_and(|later| later.contains(&alarm.code));
            is_shelved && !comes_again && active != Some(alarm.code)
        };
        let stays: Vec<_> = ended
            .into_iter()
            .enumerate()
            .filter(|(number, alarm)| is_last((*number, alarm)) || !is_too_old(alarm))
            .map(|(_, alarm)| alarm)
            .collect();
        self.saved.ended = stays;
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use proptest::prelude::*;

    use super::*;

    const SECOND: i64 = 1_000_000;

    fn at(ms: u64) -> Instant {
        Instant::ORIGIN + Duration::from_millis(ms)
    }

    /// Reads a code at this second.
    fn read(alarms: &mut Alarms, second: u64, code: u32) -> bool {
        let time = Micros(i64::try_from(second).unwrap() * SECOND);
        alarms.read(at(second * 1000), time, code, true)
    }

    fn anna(at: i64) -> Acknowledged {
        Acknowledged { by: "anna".to_owned(), at: Micros(at), comment: None }
    }

    fn shelf(code: u32, at: i64, until: i64) -> Shelf {
        let (by, reason) = ("ben".to_owned(), "worn gripper".to_owned());
        Shelf { code, by, at: Micros(at), until: Micros(until), reason }
    }

    fn ids(alarms: &Alarms) -> Vec<(u64, u32, bool)> {
        alarms.all().map(|alarm| (alarm.id, alarm.code, alarm.until.is_none())).collect()
    }

    #[test]
    fn an_alarm_that_comes_again_is_another_one_and_is_not_acknowledged() {
        let mut alarms = Alarms::default();
        assert!(!read(&mut alarms, 1, 0));
        assert_eq!(ids(&alarms), []);
        read(&mut alarms, 2, 7);
        assert_eq!(alarms.acknowledge(2_000_000, &anna(5)), Ok(true));
        let ben = Acknowledged { by: "ben".to_owned(), ..anna(6) };
        assert_eq!(alarms.acknowledge(2_000_000, &ben), Ok(false), "the first one stays");
        assert!(!read(&mut alarms, 3, 7));
        assert!(read(&mut alarms, 4, 0), "an acknowledged alarm ended");
        assert!(!read(&mut alarms, 5, 7));
        assert!(!read(&mut alarms, 6, 135), "it was not acknowledged");
        let known = [(6_000_000, 135, true), (5_000_000, 7, false), (2_000_000, 7, false)];
        assert_eq!(ids(&alarms), known);
        let acknowledged: Vec<_> = alarms.all().map(|alarm| alarm.acknowledged.clone()).collect();
        assert_eq!(acknowledged, [None, None, Some(anna(5))]);
        let until = alarms.alarm(2_000_000).unwrap().until;
        assert_eq!(until, Some(Micros(4_000_000)));
        assert_eq!(alarms.acknowledge(1, &anna(9)), Err(Denied::NoSuchAlarm));
    }

    #[test]
    fn an_alarm_goes_on_after_a_restart_and_ends_when_another_robot_answers() {
        let mut alarms = Alarms::default();
        read(&mut alarms, 2, 7);
        alarms.acknowledge(2_000_000, &anna(5)).unwrap();
        let mut alarms = Alarms::new(alarms.saved().clone());
        // The clock of the new process begins anywhere.
        assert!(!alarms.read(at(0), Micros(90 * SECOND), 7, false));
        assert_eq!(ids(&alarms), [(2_000_000, 7, true)]);
        assert_eq!(alarms.alarm(2_000_000).unwrap().acknowledged, Some(anna(5)));
        alarms.replace();
        let mut alarms = Alarms::new(alarms.saved().clone());
        assert!(alarms.read(at(1), Micros(91 * SECOND), 7, true));
        assert_eq!(ids(&alarms), [(91_000_000, 7, true), (2_000_000, 7, false)]);
        let new = alarms.alarm(91_000_000).unwrap();
        assert_eq!((new.begin_seen, &new.acknowledged), (false, &None));
        assert!(!alarms.alarm(2_000_000).unwrap().end_seen, "another robot answers");
        // A reply that was overtaken says nothing.
        assert!(!alarms.read(at(0), Micros(90 * SECOND), 0, false));
        assert_eq!(alarms.all().next().unwrap().until, None);
    }

    #[test]
    fn an_end_is_seen_only_if_the_reading_before_had_the_alarm() {
        let mut alarms = Alarms::default();
        read(&mut alarms, 2, 7);
        read(&mut alarms, 3, 135);
        // The robot was not seen for a minute, and tells no alarm then.
        alarms.read(at(63_000), Micros(63 * SECOND), 0, false);
        let ends: Vec<_> = alarms.all().map(|alarm| (alarm.code, alarm.end_seen)).collect();
        assert_eq!(ends, [(135, false), (7, true)]);
        let before = r#"{"id":5,"code":7,"since":5,"begin_seen":true,"until":9,"acknowledged":null}"#;
        assert!(!serde_json::from_str::<Alarm>(before).unwrap().end_seen, "a file from before does not tell");
    }

    #[test]
    fn a_shelf_holds_for_its_code_until_its_time_ends() {
        let mut alarms = Alarms::default();
        alarms.shelve(shelf(7, 10 * SECOND, 20 * SECOND)).unwrap();
        read(&mut alarms, 11, 7);
        read(&mut alarms, 12, 0);
        read(&mut alarms, 13, 7);
        let holds = |alarms: &Alarms, second| alarms.shelf(7, Micros(second * SECOND)).is_some();
        assert!(holds(&alarms, 13) && holds(&alarms, 19) && !holds(&alarms, 20));
        assert!(alarms.shelf(8, Micros(13 * SECOND)).is_none());
        assert!(!holds(&alarms, -51), "a clock that was set back ends it");
        alarms.shelve(shelf(7, 14 * SECOND, 30 * SECOND)).unwrap();
        assert!(holds(&alarms, 29), "it was shelved anew");
        assert!(alarms.unshelve(7, Micros(15 * SECOND)));
        assert!(!alarms.unshelve(7, Micros(15 * SECOND)) && !holds(&alarms, 15));
        for code in 1..=10 {
            alarms.shelve(shelf(code, 15 * SECOND, 30 * SECOND)).unwrap();
        }
        assert_eq!(alarms.shelve(shelf(11, 16 * SECOND, 30 * SECOND)), Err(Denied::TooManyShelved));
        assert_eq!(alarms.shelve(shelf(10, 16 * SECOND, 40 * SECOND)), Ok(()), "it has its place");
        assert_eq!(alarms.shelve(shelf(11, 31 * SECOND, 40 * SECOND)), Ok(()), "the others ended");
        assert_eq!(alarms.saved().shelves.len(), 2);
    }

    #[test]
    fn what_ended_is_forgotten_after_a_day_but_for_the_last_of_a_shelved_code() {
        let mut alarms = Alarms::default();
        for (second, code) in [(1, 7), (2, 0), (3, 7), (4, 8), (5, 0)] {
            read(&mut alarms, second, code);
        }
        let day = 86_400;
        let begin = (day - 60) * SECOND;
        alarms.shelve(shelf(7, begin, begin + 3600 * SECOND)).unwrap();
        alarms.forget(Micros((day + 5) * SECOND));
        assert_eq!(ids(&alarms), [(4_000_000, 8, false), (3_000_000, 7, false)], "the first is too old");
        alarms.forget(Micros((day + 6) * SECOND));
        assert_eq!(ids(&alarms), [(3_000_000, 7, false)]);
        alarms.forget(Micros((day + 3600) * SECOND));
        assert_eq!(alarms.saved(), &Saved { last_id: 4_000_000, ..Saved::default() });
    }

    proptest! {
        /// Whatever comes: nothing grows beyond its limit, one alarm is active at most, no number is given
        /// out twice, and each shelf has an alarm by which it can be taken away, if there was one.
        #[test]
        fn nothing_grows_and_no_number_is_used_twice(
            acts in prop::collection::vec((0..8_u8, 0..14_u32, 0..20_i64), 1..200),
        ) {
            let (mut alarms, mut now) = (Alarms::default(), 0_i64);
            let mut given = std::collections::BTreeSet::new();
            for (act, code, later) in acts {
                now += later;
                match act {
                    0..=3 => {
                        let before = alarms.saved().last_id;
                        alarms.read(at(u64::try_from(now).unwrap()), Micros(now), code, true);
                        let last = alarms.saved().last_id;
                        prop_assert!(last == before || given.insert(last));
                        prop_assert_eq!(alarms.saved().active.as_ref().map_or(0, |active| active.code), code);
                    }
                    4 => alarms.replace(),
                    5 => {
                        let id = alarms.all().map(|alarm| alarm.id).nth(code as usize);
                        if let Some(id) = id {
                            prop_assert!(alarms.acknowledge(id, &anna(now)).is_ok());
                        }
                    }
                    6 => {
                        let code = alarms.all().map(|alarm| alarm.code).nth(code as usize);
                        if let Some(code) = code {
                            let _ = alarms.shelve(shelf(code, now, now + 100));
                        }
                    }
                    _ => alarms.forget(Micros(now)),
                }
                let saved = alarms.saved();
                prop_assert!(saved.ended.len() <= MAX_ENDED && saved.shelves.len() <= MAX_SHELVED);
                prop_assert!(saved.ended.iter().all(|ended| ended.until.is_some()));
                for shelf in &saved.shelves {
                    prop_assert!(alarms.all().any(|alarm| alarm.code == shelf.code));
                }
                let text = serde_json::to_string(saved).unwrap();
                prop_assert_eq!(&serde_json::from_str::<Saved>(&text).unwrap(), saved);
            }
        }
    }
}
