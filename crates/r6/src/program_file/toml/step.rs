//! One step of a TOML program: what may stand in it, and the instruction it means.

mod signals;

use r6_proto::AxisMask;
use r6_proto::grid::Grid;
use r6_proto::message::Action;
use r6_proto::message::instruction::{
    BlendLevel, Coordinates, CurveMove, Manner, Move, PathSpeed, StopOnSignal, Workbench,
};
use serde::Deserialize;

use super::form::Wanted;
use crate::program_file::{eight, first_axes};
use crate::units;

/// Every key that a step can have, and what it wants.
#[rustfmt::skip]
pub const KEYS: [(&str, Wanted); 23] = [
    ("do", Wanted::Word(&[
        "axis-move", "linear-move", "curve-move", "wait", "output", "board-output", "stop-on-signal", "path-speed",
        "workbench",
    ])),
    ("to", Wanted::Numbers),
    ("through", Wanted::Numbers),
    ("speed", Wanted::Number),
    ("blend", Wanted::Whole(9)),
    ("delay", Wanted::Number),
    ("mask", Wanted::Mask),
    ("tool", Wanted::Whole(u32::MAX)),
    ("work_frame", Wanted::Whole(u32::MAX)),
    ("seconds", Wanted::Number),
    ("source", Wanted::Word(&["input", "m", "eu"])),
    ("board", Wanted::Whole(4)),
    ("point", Wanted::Point(32)),
    ("until", Wanted::Word(&["on", "off", "rising", "falling"])),
    ("limit", Wanted::Number),
    ("kind", Wanted::Word(&["y", "m", "euy"])),
    ("on", Wanted::Flag),
    ("pulse", Wanted::Number),
    ("set", Wanted::Wholes(31)),
    ("clear", Wanted::Wholes(31)),
    ("watch", Wanted::Flag),
    ("mm_per_s", Wanted::Number),
    ("number", Wanted::Whole(u32::MAX)),
];

/// A step as it is written: the keys of all kinds, of which each kind uses some.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Step {
    #[serde(rename = "do")]
    what: Kind,
    to: Option<Vec<f64>>,
    through: Option<Vec<f64>>,
    speed: Option<f64>,
    blend: Option<u8>,
    delay: Option<f64>,
    mask: Option<MaskWord>,
    tool: Option<u32>,
    work_frame: Option<u32>,
    seconds: Option<f64>,
    source: Option<SourceWord>,
    board: Option<u8>,
    point: Option<PointWord>,
    until: Option<UntilWord>,
    limit: Option<f64>,
    kind: Option<OutputWord>,
    on: Option<bool>,
    pulse: Option<f64>,
    set: Option<Vec<u8>>,
    clear: Option<Vec<u8>>,
    watch: Option<bool>,
    mm_per_s: Option<f64>,
    number: Option<u32>,
}

/// What a step does.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Kind {
    #[default]
    AxisMove,
    LinearMove,
    CurveMove,
    Wait,
    Output,
    BoardOutput,
    StopOnSignal,
    PathSpeed,
    Workbench,
}

/// A mask as a number or as a text.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(untagged)]
enum MaskWord {
    Bits(u8),
    Text(String),
}

/// A point as a number, or by its name on the pendant.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(untagged)]
enum PointWord {
    Number(u8),
    Name(String),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum SourceWord {
    Input,
    M,
    Eu,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum UntilWord {
    Off,
    On,
    Rising,
    Falling,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum OutputWord {
    Y,
    M,
    Euy,
}

const MOVE: [&str; 7] = ["to", "speed", "blend", "delay", "mask", "tool", "work_frame"];

impl Step {
    /// The action that the step means, or what is wrong with it.
    pub fn action(&self) -> Result<Action, String> {
        match self.what {
            Kind::AxisMove => {
                self.uses(&MOVE)?;
                let to = coordinates("to", required("to", self.to.as_deref())?, &[1, 2, 3, 4, 5, 6, 7, 8])?;
                Ok(Action::AxisMove(Move { target: to.values, manner: self.manner(to.count)? }))
            }
            Kind::LinearMove => {
                self.uses(&MOVE)?;
                let to = coordinates("to", required("to", self.to.as_deref())?, &[3, 6])?;
                Ok(Action::LinearMove(Move { target: to.values, manner: self.manner(to.count)? }))
            }
            Kind::CurveMove => {
                self.uses(&[&["through"][..], &MOVE].concat())?;
                let middle = coordinates("through", required("through", self.through.as_deref())?, &[3, 6])?;
                let end = coordinates("to", required("to", self.to.as_deref())?, &[middle.count])?;
                Ok(Action::CurveMove(CurveMove {
                    middle: middle.values,
                    end: end.values,
                    manner: self.manner(end.count)?,
                }))
            }
            Kind::Wait => self.wait(),
            Kind::Output => self.output(),
            Kind::BoardOutput => self.board_output(),
            Kind::StopOnSignal => {
                self.uses(&["point", "on", "watch"])?;
                let in_use = self.watch.unwrap_or(true);
                Ok(Action::StopOnSignal(StopOnSignal {
                    in_use,
                    input: self.watched_input()?,
                    on: if in_use { required("on", self.on)? } else { self.on.unwrap_or(false) },
                }))
            }
            Kind::PathSpeed => {
                self.uses(&["mm_per_s"])?;
                // A fraction raises alarm 219 (reported, unit B).
                let whole = |speed: f64| speed.fract() == 0.0 && (1.0..=10_000.0).contains(&speed);
                if self.mm_per_s.is_some_and(|speed| !whole(speed)) {
                    return Err("`mm_per_s` has to be a whole number from 1 to 10000".to_owned());
                }
                Ok(Action::PathSpeed(PathSpeed { in_use: self.mm_per_s.is_some(), speed: self.mm_per_s }))
            }
            Kind::Workbench => {
                self.uses(&["number"])?;
                Ok(Action::Workbench(Workbench { id: required("number", self.number)? }))
            }
        }
    }

    /// The keys that are given, besides `do`.
    fn given(&self) -> impl Iterator<Item = &'static str> {
        [
            ("to", self.to.is_some()),
            ("through", self.through.is_some()),
            ("speed", self.speed.is_some()),
            ("blend", self.blend.is_some()),
            ("delay", self.delay.is_some()),
            ("mask", self.mask.is_some()),
            ("tool", self.tool.is_some()),
            ("work_frame", self.work_frame.is_some()),
            ("seconds", self.seconds.is_some()),
            ("source", self.source.is_some()),
            ("board", self.board.is_some()),
            ("point", self.point.is_some()),
            ("until", self.until.is_some()),
            ("limit", self.limit.is_some()),
            ("kind", self.kind.is_some()),
            ("on", self.on.is_some()),
            ("pulse", self.pulse.is_some()),
            ("set", self.set.is_some()),
            ("clear", self.clear.is_some()),
            ("watch", self.watch.is_some()),
            ("mm_per_s", self.mm_per_s.is_some()),
            ("number", self.number.is_some()),
        ]
        .into_iter()
        .filter_map(|(key, given)| given.then_some(key))
    }

    /// A key that means nothing for this kind of step is a mistake.
    fn uses(&self, keys: &[&str]) -> Result<(), String> {
        match self.given().find(|key| !keys.contains(key)) {
            None => Ok(()),
            Some(key) => Err(format!("`{key}` means nothing here; this step has: {}", keys.join(", "))),
        }
    }

    fn manner(&self, given: usize) -> Result<Manner, String> {
        let mask = match &self.mask {
            None => first_axes(given),
            Some(MaskWord::Bits(bits)) => AxisMask::from_bits(*bits),
            Some(MaskWord::Text(text)) => {
                units::axis_mask(text).map_err(|wrong| format!("`mask`: {wrong}"))?
            }
        };
        if let Some(axis) = mask.axes().find(|axis| axis.index() >= given) {
            return Err(format!("mask {mask} names {axis}, for which there is no number"));
        }
        let speed = required("speed", self.speed)?;
        units::speed_percent(&speed.to_string()).map_err(|wrong| format!("`speed` is {speed}: {wrong}"))?;
        let level = self.blend.unwrap_or(0);
        let blend =
            BlendLevel::new(level).ok_or_else(|| format!("`blend` is {level}, but has to be 0 to 9"))?;
        Ok(Manner {
            mask: Some(mask),
            speed: Some(speed),
            delay: Some(seconds("delay", self.delay.unwrap_or(0.0), Grid::TENTHS_OF_A_SECOND)?),
            smooth: Some(blend),
            tool: self.tool,
            coord: self.work_frame,
        })
    }
}

/// `1 number`, `2 numbers`.
fn counted(count: usize) -> String {
    if count == 1 { "1 number".to_owned() } else { format!("{count} numbers") }
}

struct Given {
    values: Coordinates,
    count: usize,
}

fn coordinates(key: &str, values: &[f64], counts: &[usize]) -> Result<Given, String> {
    if !counts.contains(&values.len()) {
        let counts: Vec<_> = counts.iter().map(ToString::to_string).collect();
        return Err(format!("`{key}` has {}, but needs {}", counted(values.len()), counts.join(" or ")));
    }
    if let Some(wrong) = values.iter().find(|value| !(-1e6..=1e6).contains(*value)) {
        return Err(format!("`{key}` has {wrong}, which is no coordinate"));
    }
    Ok(Given { values: eight(values), count: values.len() })
}

fn required<T>(key: &str, value: Option<T>) -> Result<T, String> {
    value.ok_or_else(|| format!("`{key}` is missing"))
}

fn seconds(key: &str, value: f64, grid: Grid) -> Result<f64, String> {
    if !(0.0..=86_400.0).contains(&value) {
        return Err(format!("`{key}` has to be seconds from 0 to 86400"));
    }
    units::on_grid(grid, value).map_err(|wrong| format!("`{key}` is {value}: {wrong}"))
}

fn up_to(key: &str, value: u8, last: u8) -> Result<u8, String> {
    if value <= last { Ok(value) } else { Err(format!("`{key}` is {value}, but has to be 0 to {last}")) }
}

fn point(number: u8) -> Result<u8, String> {
    up_to("point", number, 31)
}

#[cfg(test)]
mod tests {
    use r6_proto::message::instruction::WaitSource;

    use super::*;

    fn action(toml: &str) -> Result<Action, String> {
        toml::from_str::<Step>(toml).unwrap().action()
    }

    #[test]
    fn a_line_of_three_numbers_keeps_the_orientation() {
        let Action::LinearMove(motion) = action("do=\"linear-move\"\nto=[1,2,3]\nspeed=5").unwrap() else {
            panic!()
        };
        assert_eq!(motion.manner.mask, Some(AxisMask::POSITION));
    }

    #[test]
    fn a_mask_never_moves_an_axis_without_a_number() {
        let text = "do=\"axis-move\"\nto=[1,2,3]\nspeed=5\nmask=";
        assert_eq!(
            action(&format!("{text}0x3F")).unwrap_err(),
            "mask 0x3F names J4, for which there is no number"
        );
        assert_eq!(action(&format!("{text}\"0x05\"")).map(|action| action.number()), Ok(4));
    }

    #[test]
    fn the_board_example_of_the_manual() {
        let text = "do=\"board-output\"\nset=[0,2,8,13,16,24]\nclear=[3,9,12,17,25]";
        let Action::BoardOutput(output) = action(text).unwrap() else { panic!() };
        assert_eq!((output.low.bits(), output.high.bits()), (151_388_258, 393_222));
        assert_eq!(action("do=\"board-output\"\nset=[1]\nclear=[1]").unwrap_err(), "point 1 is named twice");
    }

    #[test]
    fn a_point_goes_by_its_name_too() {
        for (named, counted) in [
            ("do=\"output\"\npoint=\"Y022\"\non=true", "do=\"output\"\npoint=10\non=true"),
            ("do=\"output\"\npoint=\"M010\"\non=true", "do=\"output\"\nkind=\"m\"\npoint=0\non=true"),
            ("do=\"output\"\npoint=\"Y1.010\"\npulse=1", "do=\"output\"\npoint=32\npulse=1"),
            (
                "do=\"wait\"\npoint=\"X1.011\"\nuntil=\"on\"",
                "do=\"wait\"\nsource=\"input\"\nboard=1\npoint=1\nuntil=\"on\"",
            ),
            ("do=\"stop-on-signal\"\npoint=\"X011\"\non=true", "do=\"stop-on-signal\"\npoint=1\non=true"),
        ] {
            assert_eq!(action(named).unwrap(), action(counted).unwrap(), "{named}");
        }
        for (wrong, says) in [
            ("do=\"output\"\npoint=\"X010\"\non=true", "X010 is an input"),
            ("do=\"output\"\npoint=\"Y1.011\"\non=true", "beyond this instruction"),
            (
                "do=\"output\"\nkind=\"y\"\npoint=\"Y010\"\non=true",
                "`kind` goes with a point that is a number",
            ),
            ("do=\"output\"\npoint=\"Y10\"\non=true", "names no point"),
            ("do=\"wait\"\npoint=\"Y010\"\nuntil=\"on\"", "Y010 is an output"),
            ("do=\"stop-on-signal\"\npoint=\"X1.010\"\non=true", "cannot stop a move"),
        ] {
            let error = action(wrong).unwrap_err();
            assert!(error.contains(says), "{wrong}: {error}");
        }
    }

    #[test]
    fn a_wait_without_a_limit_waits_for_ever() {
        let Action::Wait(wait) =
            action("do=\"wait\"\nsource=\"m\"\nboard=1\npoint=3\nuntil=\"rising\"").unwrap()
        else {
            panic!()
        };
        assert_eq!(wait.source, WaitSource::M { board: 1, point: 3 });
        assert!(wait.unlimited);
        let Action::Wait(wait) = action("do=\"wait\"\nseconds=2.5").unwrap() else { panic!() };
        assert_eq!((wait.source, wait.limit, wait.unlimited), (WaitSource::Time, 2.5, false));
    }

    #[test]
    fn wrong_steps_say_what_is_wrong() {
        for (text, wrong) in [
            ("do=\"workbench\"\nnumber=1\nspeed=5", "`speed` means nothing here; this step has: number"),
            (
                "do=\"axis-move\"\nto=[1]\nspeed=5.55",
                "`speed` is 5.55: it has to be in steps of 0.1 percent; nearest: 5.5 or 5.6",
            ),
            (
                "do=\"axis-move\"\nto=[1]\nspeed=5\ndelay=0.25",
                "`delay` is 0.25: it has to be in steps of 0.1 seconds; nearest: 0.2 or 0.3",
            ),
            (
                "do=\"wait\"\nseconds=0.01",
                "`seconds` is 0.01: it has to be in steps of 0.1 seconds; nearest: 0 or 0.1",
            ),
            ("do=\"axis-move\"\nto=[1]\nspeed=0", "`speed` is 0: it has to be percent from 0.1 to 100"),
            ("do=\"axis-move\"\nto=[1]", "`speed` is missing"),
            ("do=\"axis-move\"\nto=[nan]\nspeed=1", "`to` has NaN, which is no coordinate"),
            ("do=\"linear-move\"\nto=[1,2]\nspeed=1", "`to` has 2 numbers, but needs 3 or 6"),
            ("do=\"linear-move\"\nto=[1]\nspeed=1", "`to` has 1 number, but needs 3 or 6"),
            ("do=\"path-speed\"\nmm_per_s=0.05", "`mm_per_s` has to be a whole number from 1 to 10000"),
            ("do=\"output\"\npoint=33\non=true", "`point` is 33, but has to be 0 to 32"),
            (
                "do=\"output\"\nkind=\"m\"\npoint=3\npulse=1",
                "`pulse` is for kind \"y\" and goes without `delay`",
            ),
        ] {
            assert_eq!(action(text).unwrap_err(), wrong, "{text}");
        }
    }

    #[test]
    fn every_key_is_known() {
        let all = "do=\"wait\"\nto=[1]\nthrough=[1]\nspeed=1\nblend=1\ndelay=1\nmask=1\ntool=1\nwork_frame=1\nseconds=1\n\
                   source=\"m\"\nboard=1\npoint=1\nuntil=\"on\"\nlimit=1\nkind=\"y\"\non=true\npulse=1\nset=[1]\n\
                   clear=[1]\nwatch=true\nmm_per_s=1\nnumber=1";
        let step: Step = toml::from_str(all).unwrap();
        let names = KEYS.map(|(name, _)| name);
        assert_eq!(step.given().collect::<Vec<_>>(), names[1..]);
    }

    #[test]
    fn every_word_that_is_wanted_is_read() {
        for (key, wanted) in KEYS {
            let Wanted::Word(words) = wanted else { continue };
            for word in words {
                let head = if key == "do" { "" } else { "do=\"wait\"\n" };
                let step = toml::from_str::<Step>(&format!("{head}{key}=\"{word}\""));
                assert!(step.is_ok(), "{key} = {word}: {step:?}");
            }
        }
    }
}
