//! Alarm codes: what they mean, which axis they name, and what to do.
//!
//! The table is the pendant's own (no manual prints it). Codes marked as seen live were raised by real
//! controllers.

use std::fmt;

use crate::axis::AxisIndex;
use crate::io_point::{IoPoint, PointKind};

/// The number of an alarm, as `curAlarm` reports it; 0 means no alarm.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct AlarmCode(pub u32);

/// What an alarm code means.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Alarm {
    /// The code.
    pub code: AlarmCode,
    /// Its meaning, in a few words.
    pub text: String,
    /// The axis that the alarm names.
    pub axis: Option<AxisIndex>,
    /// What to do about it.
    pub remedy: &'static str,
    /// Whether a real controller was seen to raise it.
    pub seen_live: bool,
    /// Whether the code is in the table at all.
    pub known: bool,
}

/// How many codes a row covers, and what they count.
#[derive(Clone, Copy)]
enum Span {
    /// One code.
    One,
    /// One code for each of the eight axes; the first is J1.
    Axes,
    /// All codes up to this one. They count something other than axes.
    To(u32),
}

struct Row {
    first: u32,
    span: Span,
    text: &'static str,
    remedy: &'static str,
    seen_live: bool,
}

const SERVICE: &str = "call the machine's service with this number";
const RESTART: &str = "switch the cabinet off and on; if it comes again, call the machine's service";
const WIRING: &str = "check the cable and the power of that part, then clear the alarm";
const POINTS: &str = "if a camera sends the points, look at the camera and the part; otherwise correct the program at the pendant; then clear the alarm";
const PROGRAM: &str = "correct the program at the pendant, then clear the alarm";
const SETTINGS: &str = "check the machine settings at the pendant, then clear the alarm";
const SOFT_LIMIT: &str = "the target, or the way to it, lies beyond the soft limit: correct it, move the axis back by hand if it stands there, then clear the alarm";
const SLOWER: &str = "lower the speed or the acceleration, look for a mechanical load, then clear the alarm";
const DRIVE: &str = "read the drive's own display, let it cool or repair the cause, then clear the alarm";

const fn row(first: u32, span: Span, text: &'static str, remedy: &'static str) -> Row {
    Row { first, span, text, remedy, seen_live: false }
}

const fn live(first: u32, span: Span, text: &'static str, remedy: &'static str) -> Row {
    Row { first, span, text, remedy, seen_live: true }
}

#[rustfmt::skip]
const TABLE: &[Row] = &[
    row(1, Span::One, "not initialised", RESTART),
    row(2, Span::One, "axis configuration differs between mainboard and panel", SETTINGS),
    row(3, Span::One, "axis configuration wrong", SETTINGS),
    row(4, Span::One, "out of memory", "delete programs that are not used, then restart"),
    row(5, Span::One, "teach data cannot be read", PROGRAM),
    row(6, Span::One, "teach data cannot be edited", PROGRAM),
    live(7, Span::One, "emergency stop", "make the cell safe, release the emergency stop, then clear the alarm"),
    row(8, Span::One, "automatic jump wrong", PROGRAM),
    live(9, Span::One, "host connection failed", "the connection to the PC or panel was lost, or a heartbreak was missed: once one was sent it has to come every 10 s; restore it, then clear the alarm. A program of r6 also raises it when a camera does not answer, or has no picture"),
    row(10, Span::One, "program error", PROGRAM),
    row(11, Span::One, "configuration storage failed", RESTART),
    row(12, Span::One, "machine settings wrong", SETTINGS),
    row(13, Span::One, "single-step debugging", "leave single-step debugging at the pendant"),
    row(14, Span::One, "storage cannot be read", RESTART),
    row(15, Span::One, "IO board not connected", WIRING),
    row(16, Span::One, "servo: absolute position cannot be read", WIRING),
    row(17, Span::One, "servo: absolute position, wrong checksum", WIRING),
    row(18, Span::One, "servo: absolute position, wrong function", WIRING),
    row(19, Span::One, "servo: absolute position, timed out", WIRING),
    row(20, Span::To(22), "IO board not connected (20: board 2, 21: board 3, 22: board 4)", WIRING),
    row(23, Span::One, "program changed", "load the program again"),
    row(24, Span::One, "FPGA fault", RESTART),
    row(25, Span::One, "analogue board, wrong checksum", WIRING),
    row(26, Span::One, "analogue board, timed out", WIRING),
    row(27, Span::One, "user coordinate system wrong", SETTINGS),
    row(28, Span::One, "interval wrong", SETTINGS),
    row(29, Span::One, "position not stable", SLOWER),
    row(30, Span::One, "coordinate system is empty", SETTINGS),
    live(42, Span::One, "servo not on", "switch the servo on (after actionStop on some firmware: clear the alarm, then automatic and start at the pendant)"),
    row(90, Span::Axes, "motor alarm", DRIVE),
    row(100, Span::Axes, "axis did not run", DRIVE),
    row(110, Span::Axes, "speed setting wrong", SLOWER),
    row(120, Span::Axes, "overspeed", SLOWER),
    live(AlarmCode::POSITIVE_LIMITS, Span::Axes, "positive soft limit", SOFT_LIMIT),
    row(AlarmCode::NEGATIVE_LIMITS, Span::Axes, "negative soft limit", SOFT_LIMIT),
    row(150, Span::Axes, "position deviation too large", SLOWER),
    row(160, Span::Axes, "acceleration limit", SLOWER),
    row(170, Span::Axes, "positive limit switch", "move the axis off the switch by hand, then clear the alarm"),
    row(180, Span::Axes, "negative limit switch", "move the axis off the switch by hand, then clear the alarm"),
    row(190, Span::Axes, "origin not set", "home the machine at the pendant"),
    live(200, Span::One, "route action failed", "the path cannot be driven (out of reach, singular, or the list was replaced in mid-motion): correct the target or wait for rest, then clear the alarm"),
    row(201, Span::To(218), "points of the route are not set", POINTS),
    live(219, Span::One, "setting the route speed failed", "give a speed above 0; a path speed (action 51) is a whole number of mm/s"),
    row(220, Span::One, "route planning failed (acceleration)", SLOWER),
    row(221, Span::One, "route cannot be planned anew", SLOWER),
    row(222, Span::One, "stack waits", PROGRAM),
    row(223, Span::One, "stack has no source", PROGRAM),
    row(300, Span::One, "counter not defined", "define the counter at the pendant"),
    row(500, Span::Axes, "overcurrent", DRIVE),
    row(510, Span::Axes, "encoder Z pulse wrong", WIRING),
    row(520, Span::Axes, "no encoder Z pulse", WIRING),
    row(530, Span::Axes, "origin deviates", "check the zero marks and home the machine at the pendant"),
    row(600, Span::To(605), "unsafe area 1 to 6 (600: area 1)", "move the arm out of the area by hand, correct the target, then clear the alarm"),
    row(700, Span::Axes, "servo: initialisation", RESTART),
    row(710, Span::Axes, "servo: EEPROM", SERVICE),
    row(720, Span::Axes, "servo: analogue input", SERVICE),
    row(730, Span::Axes, "servo: execution", RESTART),
    row(740, Span::Axes, "servo: overtemperature 1", DRIVE),
    row(750, Span::Axes, "servo: overvoltage", DRIVE),
    row(760, Span::Axes, "servo: low voltage", DRIVE),
    row(770, Span::Axes, "servo: main power off", WIRING),
    row(780, Span::Axes, "servo: gate kill", DRIVE),
    row(790, Span::Axes, "servo: overtemperature 2", DRIVE),
    row(800, Span::Axes, "servo: overload", "lower the speed, send larger steps and wait for rest between them, look for a mechanical load, then clear the alarm"),
    row(810, Span::Axes, "servo: overspeed", SLOWER),
    row(820, Span::Axes, "servo: over-frequency", SLOWER),
    row(830, Span::Axes, "servo: position error", SLOWER),
    row(840, Span::Axes, "servo: encoder", WIRING),
    row(850, Span::Axes, "servo: overcurrent", DRIVE),
    row(900, Span::One, "encoder battery", "replace the battery with the cabinet switched on, then home the machine"),
    row(910, Span::One, "encoder", WIRING),
    row(1000, Span::One, "enabling is forbidden", "release what forbids it (key, guard, enabling switch)"),
    row(1500, Span::To(1691), "servo bus", WIRING),
    row(1692, Span::One, "vendor does not match", SETTINGS),
    row(1693, Span::One, "control type does not match", SETTINGS),
    row(5000, Span::To(AlarmCode::LAST.0), "user alarm of the program", "look in the program for what raises it, then clear the alarm"),
];

impl Row {
    fn last(&self) -> u32 {
        match self.span {
            Span::One => self.first,
            Span::Axes => self.first + 7,
            Span::To(last) => last,
        }
    }
}

/// The codes of waits that timed out.
const IO_WAIT: std::ops::RangeInclusive<u32> = 2048..=4095;

/// The kinds of points in the codes of waits, by their class. No document says which class is which kind;
/// this is our reading.
const CLASSES: [PointKind; 3] = [PointKind::X, PointKind::M, PointKind::Eux];

impl AlarmCode {
    /// No alarm.
    pub const NONE: Self = Self(0);

    /// The emergency stop is pressed.
    pub const EMERGENCY_STOP: Self = Self(7);

    /// No host answers a photo request, or no host feeds the watchdog.
    pub const NO_HOST: Self = Self(9);

    /// The controller cannot execute the program or an instruction.
    pub const PROGRAM: Self = Self(10);

    /// The storage cannot be read.
    pub const STORAGE: Self = Self(14);

    /// The user coordinate system (workbench) is wrong.
    pub const FRAME: Self = Self(27);

    /// The positive soft limit of J1; the codes of the other axes follow.
    const POSITIVE_LIMITS: u32 = 130;

    /// The negative soft limit of J1; the codes of the other axes follow.
    const NEGATIVE_LIMITS: u32 = 140;

    /// A move cannot be carried out, or a new list replaced the old one while the arm was moving.
    pub const ROUTE: Self = Self(200);

    /// The points of a route are not set.
    pub const NO_POINTS: Self = Self(201);

    /// A move has no speed, or the controller cannot set a path speed.
    pub const PATH_SPEED: Self = Self(219);

    /// A counter is not defined.
    pub const NO_COUNTER: Self = Self(300);

    /// The last code of the table; 5000 to this one belong to the user's programs.
    pub const LAST: Self = Self(10_000);

    /// The code of a wait for this point that timed out: class in bits 8–10, board in bits 5–7, point in bits
    /// 0–4. A time (`None`) has the code of X010.
    #[must_use]
    pub fn of_wait(point: Option<IoPoint>) -> Self {
        let IoPoint { kind, board, point } =
            point.unwrap_or(IoPoint { kind: PointKind::X, board: 0, point: 0 });
        let class = (0_u32..).zip(CLASSES).find(|(_, its)| *its == kind).map_or(0, |(class, _)| class);
        Self(IO_WAIT.start() + (class << 8) + (u32::from(board & 7) << 5) + u32::from(point & 31))
    }

    /// The positive soft limit of an axis.
    #[must_use]
    pub fn positive_limit(axis: AxisIndex) -> Self {
        Self(Self::POSITIVE_LIMITS + u32::from(axis.number()))
    }

    /// The negative soft limit of an axis.
    #[must_use]
    pub fn negative_limit(axis: AxisIndex) -> Self {
        Self(Self::NEGATIVE_LIMITS + u32::from(axis.number()))
    }

    /// Whether it is the soft limit of an axis.
    #[must_use]
    pub fn is_soft_limit(self) -> bool {
        let limits = |axis| [Self::positive_limit(axis), Self::negative_limit(axis)];
        AxisIndex::ALL.into_iter().flat_map(limits).any(|limit| limit == self)
    }

    /// Whether it is an alarm, and not [`Self::NONE`].
    #[must_use]
    pub const fn is_raised(self) -> bool {
        self.0 != 0
    }

    /// What the code means.
    #[must_use]
    pub fn decode(self) -> Alarm {
        let code = self.0;
        if !self.is_raised() {
            return Alarm {
                code: self,
                text: "no alarm".to_owned(),
                axis: None,
                remedy: "nothing",
                seen_live: true,
                known: true,
            };
        }
        if IO_WAIT.contains(&code) {
            return self.io_wait();
        }
        match TABLE.iter().find(|row| (row.first..=row.last()).contains(&code)) {
            None => Alarm {
                code: self,
                text: "not in the table of alarms".to_owned(),
                axis: None,
                remedy: "read the pendant's display",
                seen_live: false,
                known: false,
            },
            Some(row) => {
                let axis = match row.span {
                    Span::Axes => u8::try_from(code - row.first).ok().and_then(AxisIndex::new),
                    Span::One | Span::To(_) => None,
                };
                let text = axis.map_or(row.text.to_owned(), |axis| format!("{axis}: {}", row.text));
                Alarm { code: self, text, axis, remedy: row.remedy, seen_live: row.seen_live, known: true }
            }
        }
    }

    /// Decodes a wait that timed out ([`Self::of_wait`]).
    fn io_wait(self) -> Alarm {
        let bits = |shift: u32, mask: u32| u8::try_from(self.0 >> shift & mask).unwrap_or(0);
        let (class, board, point) = (bits(8, 7), bits(5, 7), bits(0, 31));
        let kind = CLASSES.get(usize::from(class)).copied();
        let name = match kind {
            Some(kind) => IoPoint { kind, board, point }.to_string(),
            None => format!("class {class}, board {board}, point {point}"),
        };
        Alarm {
            code: self,
            text: format!("waiting for {name} took too long"),
            axis: None,
            remedy: "look why the signal did not come, then clear the alarm",
            seen_live: false,
            known: true,
        }
    }
}

impl fmt::Display for Alarm {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "alarm {}: {}", self.code.0, self.text)
    }
}

impl PartialEq<u32> for AlarmCode {
    fn eq(&self, code: &u32) -> bool {
        self.0 == *code
    }
}

impl From<AlarmCode> for i64 {
    fn from(code: AlarmCode) -> Self {
        Self::from(code.0)
    }
}

impl fmt::Display for AlarmCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(code: u32) -> String {
        AlarmCode(code).decode().text
    }

    #[test]
    fn rows_stand_in_order_and_do_not_overlap() {
        for pair in TABLE.windows(2) {
            assert!(pair[0].last() < pair[1].first, "{} and {}", pair[0].first, pair[1].first);
        }
    }

    #[test]
    fn soft_limits_name_their_axis() {
        let alarm = AlarmCode(135).decode();
        assert_eq!(alarm.to_string(), "alarm 135: J6: positive soft limit");
        assert_eq!(alarm.axis.map(AxisIndex::number), Some(5));
        assert!(alarm.seen_live && alarm.known);
        assert_eq!(text(140), "J1: negative soft limit");
        assert_eq!(text(147), "J8: negative soft limit");
    }

    #[test]
    fn single_codes() {
        assert_eq!(text(0), "no alarm");
        assert_eq!(text(7), "emergency stop");
        assert_eq!(text(9), "host connection failed");
        assert_eq!(text(42), "servo not on");
        assert_eq!(text(200), "route action failed");
        assert_eq!(text(219), "setting the route speed failed");
    }

    #[test]
    fn ranges() {
        assert_eq!(text(21), text(22));
        assert_eq!(text(201), text(218));
        assert_eq!(text(600), text(605));
        assert_eq!(text(1500), text(1691));
        assert_eq!(text(5000), text(10_000));
        assert_eq!(text(857), "J8: servo: overcurrent");
    }

    #[test]
    fn waits_that_ran_out_name_their_point() {
        assert_eq!(text(2048), "waiting for X010 took too long");
        assert_eq!(text(2048 + (1 << 8) + 1), "waiting for M011 took too long");
        assert_eq!(text(2048 + (2 << 5) + 5), "waiting for X2.015 took too long");
        assert_eq!(text(4095), "waiting for class 7, board 7, point 31 took too long");
        for name in ["X010", "X2.015", "M1.011", "EUX047"] {
            let code = AlarmCode::of_wait(name.parse().ok());
            assert_eq!(code.decode().text, format!("waiting for {name} took too long"));
        }
        assert_eq!(AlarmCode::of_wait(None), 2048);
    }

    #[test]
    fn an_unknown_code_is_said_to_be_unknown() {
        for code in [31, 98, 148, 224, 606, 858, 1694, 4096, 10_001, u32::MAX] {
            assert!(!AlarmCode(code).decode().known, "{code}");
        }
    }
}
