//! The list of faults: what fails in each case, and how the client notices it.

use r6_controller::Event;
use r6_controller::scenario::Happening;
use std::time::Duration;

use r6_client::Cause;

use crate::tap::Rewrite;
use crate::work::Fate;
use crate::world::Outcome;

/// The fault of a case.
#[derive(Clone, Copy, Debug)]
pub enum Text {
    /// A file of `examples/scenarios`.
    File,
    /// A scenario that only this case has.
    Own(&'static str),
}

/// One case.
#[derive(Clone, Copy)]
pub struct Case {
    /// The number of the fault, and the name of this variant.
    pub name: &'static str,
    pub text: Text,
    /// The firmware on which it happens; `None`: each firmware in turn.
    pub profile: Option<&'static str>,
    /// How long after the end of the fault the delayed traffic has passed, ms.
    pub held_up: u64,
    pub rewrite: Option<Rewrite>,
    /// Whether another client is present.
    pub another: bool,
    /// Whether the outcome shows that the client noticed the fault. Without the fault this is `false`.
    pub felt: fn(&Outcome) -> bool,
}

const fn own(name: &'static str, text: &'static str, felt: fn(&Outcome) -> bool) -> Case {
    Case { text: Text::Own(text), ..file(name, felt) }
}

const fn file(name: &'static str, felt: fn(&Outcome) -> bool) -> Case {
    Case { name, text: Text::File, profile: None, held_up: 0, rewrite: None, another: false, felt }
}

const fn from(case: Case, these: &'static [u8], those: &'static [u8]) -> Case {
    let (from, until) = (Duration::from_secs(3), Duration::from_secs(9));
    Case { rewrite: Some(Rewrite { these, those, from, until }), ..case }
}

/// A name in GBK, as Chinese pendants write it: two bytes per character. The second byte may be the escape of
/// a quote.
const GBK: Rewrite = Rewrite {
    these: b"r6 virtual BRTIRUS0707A",
    those: b"\xbb\xfa\xc6\xf7",
    from: Duration::ZERO,
    until: Duration::from_secs(3600),
};

/// An event, so that a case without a fault of the controller has a length.
const NINE_SECONDS: &str = "[[at]]\ntime = 9\ndo = \"input\"\npoint = \"X010\"\non = true\n";

const UNKNOWN_ALARM: &str = "[[at]]\ntime = 4\ndo = \"alarm\"\nnumber = 4711\nevery = 2\ntimes = 3\n";

const CROSSED: &str = "[[fault]]\nfault = \"crossed-reply\"\nfrom = 3\nfor = 6\n";

/// A client that has to wait after every list gets the replies to requests that it no longer waits for.
const LATE_WITHOUT_NUMBERS: &str =
    "[[fault]]\nfault = \"late-reply\"\ndelay = 2.5\nchance = 0.2\nfrom = 3\nfor = 8\n";

const SHORT_LISTS: &str = "[[fault]]\nfault = \"bad-list\"\nkind = \"short\"\nchance = 0.5\nfrom = 3\nfor = 4\n\
    [[fault]]\nfault = \"bad-list\"\nkind = \"long\"\nchance = 0.5\nfrom = 8\nfor = 4\n";

/// The connection ends within the replies. When it comes back, the controller answers late.
const RESETS_AND_LATENCY: &str = "[[fault]]\nfault = \"reset-mid-frame\"\nchance = 0.1\nfrom = 3\nfor = 8\n\
    [[fault]]\nfault = \"latency\"\nto_controller = 0.01\nto_client = 0.02\nspread = 0.05\nfrom = 3\nfor = 8\n";

const TINY: &str = "[[fault]]\nfault = \"pieces\"\nbytes = 1\nfrom = 3\nfor = 4\n\
    [[fault]]\nfault = \"slow\"\nbytes_per_second = 2000\nfrom = 3\nfor = 4\n";

/// All cases except those of the client itself (`cancelled.rs`, `killed.rs`).
pub const CASES: &[Case] = &[
    file("T1-refuse", |seen| seen.line.refused > 2),
    file("T2-black-hole", |seen| seen.line.unanswered > 0),
    file("T3-silence", |seen| seen.line.sent.len() > 2 && seen.quality.timeouts > 1),
    file("T4-reset-mid-frame", |seen| seen.line.resets > 3),
    Case { held_up: 80, ..own("T4-and-latency", RESETS_AND_LATENCY, |seen| seen.line.resets > 0) },
    file("T5-close-before-reply", |seen| seen.line.ends > 3),
    file("T6-half-open", |seen| seen.line.sent.len() > 1),
    file("T7-pieces", |seen| seen.line.parts > 300),
    file("T7-coalesce", |seen| seen.slowest() > Duration::from_millis(50) || seen.quality.timeouts > 0),
    own("T7-and-slow", TINY, |seen| seen.line.parts > 300),
    Case { held_up: 3000, ..file("T8-latency", |seen| seen.quality.timeouts > 1) },
    file("T9-slow", |seen| seen.quality.timeouts > 1),
    file("T14-stall", |seen| seen.line.parts > 10),
    file("P1-bad-json", |seen| seen.quality.garbled > 5),
    file("P2-bad-field", |seen| seen.notes.unreadable + seen.notes.failures > 0),
    // Without numbers, a reply that comes twice looks the same as the next reply.
    Case { profile: Some("hc1"), ..file("P3-bad-pack-id", |seen| seen.quality.strays > 2) },
    Case { held_up: 5000, ..file("P3-late-reply", |seen| seen.quality.timeouts > 0) },
    Case {
        held_up: 2500,
        profile: Some("legacy"),
        ..own("P3-late-without-numbers", LATE_WITHOUT_NUMBERS, |seen| seen.quality.timeouts > 0)
    },
    // Without numbers, a reply to another client's request looks the same as an own reply.
    Case {
        profile: Some("hc1"),
        another: true,
        ..own("P4-crossed-reply", CROSSED, |seen| seen.quality.strays > 5)
    },
    file("P5-bad-list", |seen| seen.asked_alone() > 12),
    own("P5-short-and-long", SHORT_LISTS, |seen| seen.asked_alone() > 12),
    file("P6-echo", |seen| seen.quality.strays > 5 && seen.quality.timeouts > 1),
    file("P7-unsolicited", |seen| seen.quality.strays > 5),
    Case { profile: Some("r6-host"), ..own("P8-r6-host", NINE_SECONDS, |seen| seen.has_no_numbers()) },
    Case { profile: Some("r6-pendant"), ..own("P8-r6-pendant", NINE_SECONDS, |seen| seen.has_no_numbers()) },
    Case { profile: Some("legacy"), ..own("P8-legacy", NINE_SECONDS, |seen| seen.has_no_numbers()) },
    Case {
        rewrite: Some(GBK),
        ..own("P8-gbk", NINE_SECONDS, |seen| seen.machine_name.as_deref() == Some("机器"))
    },
    // A list that is not carried out may also be ended by another client's stop before this is noticed.
    file("P10-not-executed", |seen| seen.events.iter().any(not_executed)),
    file("P10-not-acknowledged", |seen| seen.notes.commands(&Fate::Unknown) > 0),
    file("P11-list-full", |seen| seen.notes.ended(|cause| matches!(cause, Cause::Refused(_))) > 0),
    file("P11-list-frozen", |seen| {
        seen.notes.ended(|cause| matches!(cause, Cause::Stalled { .. } | Cause::Elsewhere(_))) > 0
    }),
    file("P12-rejected-mid-batch", |seen| seen.notes.ended(|cause| !matches!(cause, Cause::StoppedHere)) > 0),
    file("P13-task-dead", |seen| seen.quality.timeouts > 3 && seen.line.sent.len() > 1),
    own("P9-unknown-alarm", UNKNOWN_ALARM, |seen| {
        seen.notes.ended(|cause| matches!(cause, Cause::AlarmRaised { code: 4711 })) > 0
    }),
    from(
        own("P9-unknown-verdict", NINE_SECONDS, |seen| seen.notes.commands(&Fate::Unknown) > 0),
        b"\"ok\"",
        b"\"E4711\"",
    ),
    file("P14-two-masters", |seen| seen.events.iter().any(another_master)),
    Case { another: true, ..own("P14-second-client", NINE_SECONDS, |seen| seen.ended_by_others() > 0) },
];

fn not_executed(event: &Event) -> bool {
    matches!(event, Event::CommandAccepted { done: false, .. } | Event::ListTaken { done: false, .. })
}

fn another_master(event: &Event) -> bool {
    matches!(event, Event::Happens { what: Happening::Request(_) })
}

impl Outcome {
    /// Whether the client learned that this firmware does not say which request it answers.
    fn has_no_numbers(&self) -> bool {
        self.learned.echoes_pack_id == Some(false)
    }

    /// How long the slowest reply took.
    fn slowest(&self) -> Duration {
        self.quality.latency.map_or(Duration::ZERO, |latency| latency.max)
    }

    /// The number of queries for one address, which come from splitting a list.
    fn asked_alone(&self) -> usize {
        let alone =
            |frame: &serde_json::Value| frame["queryAddr"].as_array().is_some_and(|asked| asked.len() == 1);
        self.line.frames().iter().filter(|frame| alone(frame)).count()
    }

    /// The number of motions that another master ended.
    fn ended_by_others(&self) -> usize {
        self.notes.ended(|cause| matches!(cause, Cause::Stopped { .. } | Cause::Elsewhere(_)))
    }
}

impl Case {
    /// The fault that this case belongs to.
    pub fn fault(&self) -> &'static str {
        self.name.split('-').next().unwrap_or_default()
    }
}

/// A case without a fault.
pub fn nothing() -> Case {
    own("nothing", NINE_SECONDS, |_| false)
}
