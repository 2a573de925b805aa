//! The alarms of a robot: what is read of them, and who acknowledges and shelves them. Nothing of this goes
//! to the robot.

use std::time::Duration;

use r6_api::gateway::{
    Acknowledged, AuditRecord, Deed, Happened, RobotAlarm, RobotAlarmState, Shelved, SignalQuality,
};
use r6_api::{Alarm as Meaning, Code};
use r6_client::{Address, Recorded};
use r6_proto::Reading;
use r6_proto::alarm::AlarmCode;
use r6_proto::time::Instant;

use super::station::{By, Station};
use crate::clock::{self, text};
use crate::core::alarms::{self, Alarm, Alarms, Denied, MAX_SHELVED, Shelf};
use crate::core::history::event::{Event, Observed};
use crate::core::history::sample::Micros;
use crate::problem::Problem;
use crate::store::StoreError;

impl Station {
    /// Takes in the values of a poll of this robot, and what happened since the one before.
    pub(super) fn read_alarm(
        &self,
        now: Instant,
        values: &[Recorded],
        events: &[Event],
        time: impl Fn(Instant) -> Micros,
    ) {
        let of_alarm = |value: &&Recorded| value.address == Address::CurAlarm;
        let Some(value) = values.iter().find(of_alarm) else { return };
        let Some(Reading::Integer(code)) = value.reading else { return };
        let Ok(code) = u32::try_from(code) else { return };
        let at = clock::before(now, value.age);
        let is_of_alarm = |event: &Event| {
            matches!(event.observed, Observed::AlarmBegan { .. } | Observed::AlarmEnded { .. })
        };
        let change_seen = events.iter().any(is_of_alarm);
        let ends_soon = self.desk.with(|alarms| alarms.read(at, time(at).kept(), code, change_seen));
        if ends_soon {
            self.to_write.notify_one();
        }
    }

    /// Another robot answers in place of this one.
    pub(super) fn replace_alarms(&self) {
        self.desk.with(Alarms::replace);
    }

    /// Forgets old alarms. Returns whether there is something to save.
    pub(super) fn tidy_alarms(&self) -> bool {
        self.desk.tidy(self.time())
    }

    /// Saves the alarms, if they changed.
    pub(super) async fn save_alarms(&self) -> Result<(), StoreError> {
        self.desk.save(&self.term.keeper, &self.config().name).await
    }

    /// The alarms that are known: the active one first, then those that ended, the latest first.
    pub fn alarms(&self) -> Vec<RobotAlarm> {
        let (now, is_seen) = (self.time(), self.sees_alarm());
        self.desk.with(|alarms| alarms.all().map(|alarm| self.shown(alarms, alarm, now, is_seen)).collect())
    }

    /// Acknowledges an alarm: somebody saw it. The first one to acknowledge it stays.
    ///
    /// # Errors
    /// `no_such_alarm`, `store_unavailable`.
    pub async fn acknowledge(
        &self,
        by: &By,
        id: u64,
        comment: Option<String>,
    ) -> Result<RobotAlarm, Problem> {
        let at = self.time();
        let acknowledged = alarms::Acknowledged { by: by.actor.clone(), at, comment: comment.clone() };
        self.change(id, at, |alarms, alarm| {
            if !alarms.acknowledge(id, &acknowledged)? {
                return Ok(None);
            }
            let code = alarm.code;
            let happened = Happened::AlarmAcknowledged {
                alarm: id,
                code,
                text: meaning(code).text,
                by: by.actor.clone(),
                comment: comment.clone(),
            };
            let deed = Deed::AlarmAcknowledged { alarm: id, code, comment: comment.clone() };
            Ok(Some((self.record(by, deed), happened)))
        })
        .await
    }

    /// Shelves the alarms of the code of this one for a time, or anew.
    ///
    /// # Errors
    /// `no_such_alarm`, `no_room`, `store_unavailable`.
    pub async fn shelve(
        &self,
        by: &By,
        id: u64,
        lasts: Duration,
        reason: String,
    ) -> Result<RobotAlarm, Problem> {
        let at = self.time();
        let until = at.after(lasts).kept();
        self.change(id, at, |alarms, alarm| {
            let (code, reason) = (alarm.code, reason.clone());
            alarms.shelve(Shelf { code, by: by.actor.clone(), at, until, reason: reason.clone() })?;
            let deed = Deed::AlarmShelved { code, until: text(until), reason: reason.clone() };
            let happened = Happened::AlarmShelved {
                code,
                text: meaning(code).text,
                by: by.actor.clone(),
                until: text(until),
                reason,
            };
            Ok(Some((self.record(by, deed), happened)))
        })
        .await
    }

    /// Takes the alarms of the code of this one from the shelf, if they are there.
    ///
    /// # Errors
    /// `no_such_alarm`, `store_unavailable`.
    pub async fn unshelve(&self, by: &By, id: u64) -> Result<RobotAlarm, Problem> {
        let at = self.time();
        self.change(id, at, |alarms, alarm| {
            let code = alarm.code;
            if !alarms.unshelve(code, at) {
                return Ok(None);
            }
            let (text, by_name) = (meaning(code).text, by.actor.clone());
            let happened = Happened::AlarmUnshelved { code, text, by: by_name };
            Ok(Some((self.record(by, Deed::AlarmUnshelved { code }), happened)))
        })
        .await
    }

    /// Changes something about the alarm with this number, tells of it, and returns how the alarm is then.
    async fn change(
        &self,
        id: u64,
        now: Micros,
        act: impl Fn(&mut Alarms, &Alarm) -> Result<Option<(AuditRecord, Happened)>, Denied>,
    ) -> Result<RobotAlarm, Problem> {
        let robot = self.config().name;
        let is_seen = self.sees_alarm();
        let changed = self.desk.change(&self.term.keeper, &robot, |alarms| {
            let alarm = alarms.alarm(id).cloned().ok_or(Denied::NoSuchAlarm)?;
            let (record, happened) = act(alarms, &alarm)?.unzip();
            let alarm = alarms.alarm(id).unwrap_or(&alarm);
            Ok(((self.shown(alarms, alarm, now, is_seen), happened), record))
        });
        let (alarm, happened) = changed.await?;
        happened.into_iter().for_each(|happened| self.publish(happened));
        Ok(alarm)
    }

    /// Whether the robot is seen to tell its alarm now.
    fn sees_alarm(&self) -> bool {
        let answers = self.seat(|seat, _| seat.is_up() && seat.identity_change().is_none());
        let read = self.board().signal(clock::now(), Address::CurAlarm);
        answers && read.is_some_and(|(signal, _)| signal.quality == SignalQuality::Fresh)
    }

    /// The time of day, as the history has it.
    fn time(&self) -> Micros {
        let history = self.shared.history.as_ref();
        history.map_or_else(|| clock::system().kept(), |history| history.time(clock::now()))
    }

    fn shown(&self, alarms: &Alarms, alarm: &Alarm, now: Micros, is_seen: bool) -> RobotAlarm {
        let Alarm { id, code, since, begin_seen, until, end_seen, acknowledged } = alarm.clone();
        let Meaning { text: words, axis, remedy, .. } = meaning(code);
        RobotAlarm {
            robot: self.name().to_owned(),
            id,
            code,
            text: words,
            axis,
            remedy,
            state: match until {
                Some(_) => RobotAlarmState::Ended,
                // If another robot answers since, its alarm is not read yet.
                None if is_seen && !alarms.saved().is_replaced => RobotAlarmState::Active,
                None => RobotAlarmState::Unseen,
            },
            since: text(since),
            begin_seen,
            until: until.map(text),
            end_seen,
            acknowledged: acknowledged.map(|of| Acknowledged {
                by: of.by,
                at: text(of.at),
                comment: of.comment,
            }),
            shelved: alarms.shelf(code, now).map(|shelf| Shelved {
                by: shelf.by.clone(),
                at: text(shelf.at),
                until: text(shelf.until),
                reason: shelf.reason.clone(),
            }),
        }
    }
}

fn meaning(code: u32) -> Meaning {
    Meaning::of(AlarmCode(code))
}

impl From<Denied> for Problem {
    fn from(denied: Denied) -> Self {
        match denied {
            Denied::NoSuchAlarm => {
                Self::new(Code::NoSuchAlarm, "the robot has no such alarm, or it ended long ago")
            }
            Denied::TooManyShelved => Self::new(
                Code::NoRoom,
                format!("{MAX_SHELVED} codes of this robot are shelved: unshelve one first"),
            ),
        }
    }
}
