use proptest::prelude::*;

use super::*;

const HOUR: i64 = 3_600_000_000;

fn shift(name: &str, days: &str, begin: &str, end: &str) -> Shift {
    let days = days.split(' ').filter(|day| !day.is_empty()).map(|day| Weekday::of_word(day).unwrap());
    Shift { name: name.to_owned(), days: days.collect(), begin: begin.to_owned(), end: end.to_owned() }
}

const WEEK: &str = "mon tue wed thu fri sat sun";

fn hall(zone: &str, shifts: Vec<Shift>) -> Hall {
    Hall::new(HallSettings { time_zone: zone.to_owned(), shifts }).unwrap()
}

/// A hall with the three usual shifts.
fn three(zone: &str) -> Hall {
    let night = shift("night", WEEK, "22:00", "06:00");
    hall(zone, vec![shift("early", WEEK, "06:00", "14:00"), shift("late", WEEK, "14:00", "22:00"), night])
}

fn utc(text: &str) -> Micros {
    Micros(text.parse::<Timestamp>().unwrap().as_microsecond())
}

fn hours(found: &Occurrence) -> i64 {
    (found.end.0 - found.begin.0) / HOUR
}

#[test]
fn a_night_that_crosses_the_change_has_7_or_9_hours() {
    let berlin = three("Europe/Berlin");
    // Summer time begins on 2026-03-29 and ends on 2026-10-25.
    let spring = berlin.shift("night", "2026-03-28").unwrap();
    assert_eq!((spring.begin, hours(&spring)), (utc("2026-03-28T21:00:00Z"), 7));
    let autumn = berlin.shift("night", "2026-10-24").unwrap();
    assert_eq!((autumn.begin, hours(&autumn)), (utc("2026-10-24T20:00:00Z"), 9));
    for date in ["2026-03-27", "2026-03-29", "2026-10-23", "2026-10-25", "2026-12-31"] {
        assert_eq!(hours(&berlin.shift("night", date).unwrap()), 8, "{date}");
    }
    let day = hall("Europe/Berlin", vec![shift("day", WEEK, "00:00", "24:00")]);
    let of_day = |date| hours(&day.shift("day", date).unwrap());
    assert_eq!((of_day("2026-03-29"), of_day("2026-10-25"), of_day("2026-06-01")), (23, 25, 24));
    // There the change is at midnight, and half an hour.
    let havana = three("America/Havana");
    assert_eq!(hours(&havana.shift("night", "2026-03-07").unwrap()), 7);
    let island = three("Australia/Lord_Howe").shift("night", "2026-04-04").unwrap();
    assert_eq!(island.end.0 - island.begin.0, 8 * HOUR + HOUR / 2);
}

#[test]
fn a_zone_without_a_change_has_8_hours_each_night() {
    let shanghai = three("Asia/Shanghai");
    for date in ["2026-03-28", "2026-03-29", "2026-10-24", "2026-10-25"] {
        assert_eq!(hours(&shanghai.shift("night", date).unwrap()), 8, "{date}");
    }
    let night = shanghai.shift("night", "2026-11-25").unwrap();
    assert_eq!((night.begin, night.date.as_str()), (utc("2026-11-25T14:00:00Z"), "2026-11-25"));
}

#[test]
fn a_begin_in_a_gap_is_the_change_and_one_in_a_fold_is_the_first() {
    let shifts = vec![
        shift("a", WEEK, "22:00", "02:30"),
        shift("b", WEEK, "02:30", "03:00"),
        shift("c", WEEK, "03:00", "06:00"),
    ];
    let berlin = hall("Europe/Berlin", shifts);
    let change = utc("2026-03-29T01:00:00Z");
    let (a, c) = (berlin.shift("a", "2026-03-28").unwrap(), berlin.shift("c", "2026-03-29").unwrap());
    assert_eq!((a.end, c.begin, hours(&c)), (change, change, 3));
    assert_eq!(berlin.shift("b", "2026-03-29"), Err(NoShift::LeftOut), "no time is left for it");
    // In autumn 02:30 comes twice.
    let first = utc("2026-10-25T00:30:00Z");
    let (a, b) = (berlin.shift("a", "2026-10-24").unwrap(), berlin.shift("b", "2026-10-25").unwrap());
    assert_eq!((a.end, b.begin), (first, first));
    assert_eq!(b.end.0 - b.begin.0, HOUR + HOUR / 2);
}

#[test]
fn shifts_of_a_range_are_those_that_begin_in_it() {
    let berlin = three("Europe/Berlin");
    let told = |from, to, most| {
        let found = berlin.beginning(utc(from), utc(to), most);
        found.into_iter().map(|found| format!("{} {}", found.date, found.name)).collect::<Vec<_>>()
    };
    // 05:00 UTC is 06:00 there.
    let day = ["2026-11-25 early", "2026-11-25 late", "2026-11-25 night"];
    assert_eq!(told("2026-11-25T05:00:00Z", "2026-11-26T05:00:00Z", 100), day);
    assert_eq!(told("2026-11-25T05:00:00Z", "2026-11-25T21:00:00Z", 100), day[..2]);
    assert_eq!(told("2026-11-25T05:00:00.000001Z", "2026-11-25T21:00:00.000001Z", 100), day[1..]);
    assert_eq!(told("2026-11-25T05:00:00Z", "2026-12-25T05:00:00Z", 4).len(), 4);
    assert_eq!(told("2026-11-25T05:00:00Z", "2026-12-25T05:00:00Z", 100).len(), 90);
    assert!(told("2026-11-25T05:00:00Z", "2026-11-25T05:00:00Z", 100).is_empty());
    let kiritimati = hall("Pacific/Apia", vec![shift("day", WEEK, "08:00", "16:00")]);
    // It left out a day.
    assert_eq!(kiritimati.shift("day", "2011-12-30"), Err(NoShift::LeftOut));
    let found = kiritimati.beginning(utc("2011-12-29T00:00:00Z"), utc("2012-01-01T00:00:00Z"), 9);
    let dates: Vec<_> = found.iter().map(|found| found.date.as_str()).collect();
    assert_eq!(dates, ["2011-12-29", "2011-12-31", "2012-01-01"]);
}

#[test]
fn a_shift_that_is_not_there_is_told_with_its_reason() {
    let work = hall("Europe/Berlin", vec![shift("early", "mon tue", "06:00", "14:00")]);
    assert_eq!(work.shift("late", "2026-11-23"), Err(NoShift::Name));
    for date in
        ["", "today", "2026-02-29", "2026-1-1", "20261123", "2026-11-23T00", "+026-11-23", "2026-13-01"]
    {
        assert_eq!(work.shift("early", date), Err(NoShift::Date), "{date}");
    }
    assert_eq!(work.shift("early", "2026-11-25"), Err(NoShift::Day(Weekday::Wed)));
    assert!(work.shift("early", "2026-11-24").is_ok());
    assert!(work.shift("early", "9999-12-28").is_ok() || work.shift("early", "9999-12-27").is_ok());
    assert!(Hall::usual().beginning(Micros(0), Micros(i64::MAX), 9).is_empty());
    assert_eq!(Hall::usual().shift("early", "2026-11-25"), Err(NoShift::Name));
}

#[test]
fn every_mistake_is_told_with_its_place() {
    let mistakes = |zone: &str, shifts: Vec<Shift>| -> Vec<String> {
        let wrong = Hall::new(HallSettings { time_zone: zone.to_owned(), shifts }).unwrap_err();
        wrong.iter().map(ToString::to_string).collect()
    };
    let told = mistakes("Europe/Berln", vec![shift("Early", "", "6:00", "24:01")]);
    for (told, part) in told.iter().zip([
        "time_zone: `Europe/Berln` is no time zone of the IANA database; nearest: `Europe/Berlin`",
        "shifts[0].name: a shift has a name of",
        "shifts[0].days: a shift begins on one day",
        "shifts[0].begin: `6:00` is not a time",
        "shifts[0].end: `24:01` is not a time",
    ]) {
        assert!(told.starts_with(part), "{told}");
    }
    assert_eq!(told.len(), 5);
    let lower = mistakes("europe/berlin", Vec::new());
    assert_eq!(lower, ["time_zone: the time zone is written `Europe/Berlin`"]);
    for zone in ["", "local", "../UTC", "UTC+1", "EST5EDT4", &"x".repeat(5000)] {
        assert!(mistakes(zone, Vec::new())[0].starts_with("time_zone: `"), "{zone}");
    }
    let one = |begin, end| shift("a", "mon", begin, end);
    for (wrong, part) in [
        (one("06:00", "06:00"), "shifts[0].end: it is the begin"),
        (one("24:00", "06:00"), "shifts[0].begin: `24:00`"),
        (one("06:60", "07:00"), "shifts[0].begin: `06:60`"),
        (one("06:00", "0é:0"), "shifts[0].end: "),
        (shift("a", "mon tue mon", "06:00", "07:00"), "shifts[0].days: `mon` is there twice"),
    ] {
        let told = mistakes("UTC", vec![wrong]);
        assert!(told.len() == 1 && told[0].starts_with(part), "{told:?}");
    }
    let twice = mistakes("UTC", vec![one("06:00", "07:00"), shift("a", "tue", "06:00", "07:00")]);
    assert_eq!(twice, ["shifts[1].name: two shifts are called `a`"]);
    let night = shift("night", "sun", "22:00", "06:00");
    let over = mistakes("UTC", vec![night.clone(), shift("early", "mon tue", "05:59", "14:00")]);
    assert_eq!(over, ["shifts[1].begin: on mon it overlaps with `night`"], "over the end of the week");
    hall("UTC", vec![night, shift("early", "mon tue", "06:00", "14:00")]);
    let many = (0..13).map(|number| shift(&format!("s{number}"), "mon", "00:00", "00:01"));
    let told = mistakes("UTC", many.collect());
    assert_eq!(told[0], "shifts: there are at most 12");
    assert!(told.len() <= MAX_MISTAKES);
}

proptest! {
    /// In every zone, on every day: shifts that were taken never overlap, and come in their order.
    #[test]
    fn shifts_never_overlap(
        zone in prop::sample::select(vec![
            "UTC", "Europe/Berlin", "America/New_York", "America/Havana", "Australia/Lord_Howe", "Asia/Shanghai",
            "America/Sao_Paulo", "Pacific/Apia", "Africa/Casablanca", "Asia/Kathmandu",
        ]),
        times in prop::collection::btree_set(0..1_440_u16, 2..8),
        begin in 0_i64..2_000_000_000,
        days in 1_i64..40,
    ) {
        let text = |minutes: u16| format!("{:02}:{:02}", minutes / 60, minutes % 60);
        let times: Vec<_> = times.into_iter().collect();
        let next = times.iter().cycle().skip(1);
        let shifts = times.iter().zip(next).enumerate().map(|(number, (begin, end))| {
            shift(&format!("s{number}"), WEEK, &text(*begin), &text(*end))
        });
        let hall = hall(zone, shifts.collect());
        let from = Micros(begin * 1_000_000);
        let to = Micros(from.0 + days * 24 * HOUR);
        let found = hall.beginning(from, to, 1_000);
        for pair in found.windows(2) {
            prop_assert!(pair[0].end <= pair[1].begin, "{pair:?}");
            // All of the day has shifts, so they leave nothing out either.
            prop_assert_eq!(pair[0].end, pair[1].begin);
        }
        for found in &found {
            prop_assert!((from..to).contains(&found.begin) && found.begin < found.end);
            prop_assert_eq!(&hall.shift(&found.name, &found.date), &Ok(found.clone()));
        }
        prop_assert!(found.len() + times.len() * 2 >= times.len() * usize::try_from(days).unwrap());
    }
}
