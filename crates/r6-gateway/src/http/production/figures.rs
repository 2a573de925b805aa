//! The figures of one range as the contract has them.

use std::cmp::Reverse;
use std::time::Duration;

use r6_api::Alarm;
use r6_api::gateway::{
    AlarmFigure, AlarmFigures, Availability, CycleFigures, PartFigures, Production, StateFigures,
};
use r6_proto::alarm::AlarmCode;

use super::super::range::Range;
use crate::clock::{self, text};
use crate::core::history::sample::Micros;
use crate::core::production::Figures;
use crate::fleet::config::RobotConfig;
use crate::history::query::ProductionAnswer;

/// How many alarms are listed.
const TOP: usize = 20;

/// What the availability is.
const AVAILABILITY: &str = "running_of_seen_time";

/// The figures of a robot in a range.
pub(super) fn shown(
    config: &RobotConfig,
    Range { from, to }: Range,
    answer: ProductionAnswer,
    kept_until: Option<Micros>,
) -> Production {
    let ProductionAnswer { figures, unreadable, .. } = answer;
    let alarms = alarms(&figures);
    Production {
        robot: config.name.to_string(),
        from: text(from),
        to: text(to),
        shift: None,
        seen_ms: ms(figures.seen()),
        unseen_ms: ms(figures.unseen),
        states: StateFigures {
            running_ms: ms(figures.running),
            waiting_ms: ms(figures.waiting),
            alarm_ms: ms(figures.alarm),
            manual_ms: ms(figures.manual),
            other_ms: ms(figures.other),
            computed_from: from_words(["curMode", "curAlarm", "unseen"]),
        },
        availability: Availability {
            value: figures.availability(),
            definition: AVAILABILITY.to_owned(),
            computed_from: from_words(["curMode", "curAlarm", "unseen"]),
        },
        parts: PartFigures {
            count: figures.parts,
            resets: figures.part_resets,
            computed_from: config
                .parts()
                .map(|address| address.to_string())
                .into_iter()
                .chain(from_words(["parts", "parts_reset"]))
                .collect(),
        },
        cycles: cycles(figures),
        alarms,
        kept_until: kept_until.map(text),
        unreadable,
    }
}

fn cycles(figures: Figures) -> CycleFigures {
    let (p50_ms, p90_ms) = (figures.percentile(50), figures.percentile(90));
    let times = figures.cycle_times;
    CycleFigures {
        count: figures.cycles,
        at_least: figures.cycles_at_least,
        timed: times.len() as u64,
        p50_ms,
        p90_ms,
        min_ms: times.first().copied(),
        max_ms: times.last().copied(),
        mean_ms: mean(&times),
        computed_from: from_words(["lastCycle", "curCycle", "curMode", "cycle_done"]),
    }
}

#[expect(clippy::cast_precision_loss, reason = "cycles of a month, in ms, are below 2^53")]
fn mean(times: &[u64]) -> Option<f64> {
    let sum: u64 = times.iter().sum();
    (!times.is_empty()).then(|| (sum as f64 / times.len() as f64 * 1000.0).round() / 1000.0)
}

fn alarms(figures: &Figures) -> AlarmFigures {
    let mut all: Vec<_> = figures.alarms.iter().map(|(code, (count, lost))| (*code, *count, *lost)).collect();
    all.sort_by_key(|(code, count, lost)| (Reverse(*lost), Reverse(*count), *code));
    let top = all.iter().take(TOP).map(|(code, count, lost)| {
        let Alarm { text, remedy, .. } = Alarm::of(AlarmCode(*code));
        AlarmFigure { code: *code, text, remedy, count: *count, lost_ms: ms(*lost) }
    });
    AlarmFigures {
        codes: all.len() as u64,
        top: top.collect(),
        computed_from: from_words(["curAlarm", "curMode", "alarm_began", "unseen"]),
    }
}

fn from_words<const N: usize>(words: [&str; N]) -> Vec<String> {
    words.map(str::to_owned).into()
}

/// Milliseconds of µs.
fn ms(micros: i64) -> f64 {
    clock::milliseconds(Duration::from_micros(u64::try_from(micros).unwrap_or(0)))
}
