//! Executes one request and replies to it.

use std::time::Duration;

use serde_json::{Value, json};

use super::agenda::Due;
use super::arm::Arm;
use super::body::Body;
use super::character::{Character, Late, ListLength, NeverExecuted, Reaction};
use super::log::Did;
use super::step::{Act, Step};
use super::track::WORLD_OFFSET;
use super::{AXES, Kind};

/// What was done, and the reply with its delay.
struct Outcome {
    did: Did,
    reply: Option<(Value, Duration)>,
}

/// The kind of a request, by its type.
pub(super) fn kind(frame: &Value) -> Kind {
    match frame["reqType"].as_str().or_else(|| frame["cmdType"].as_str()) {
        Some("query") => Kind::Query,
        Some("command") => Kind::Command,
        Some("AddRCC") => Kind::List,
        Some(_) | None => Kind::Other,
    }
}

impl Arm {
    /// Executes a frame. Its reply is sent only if `audible`.
    pub(super) fn handle(&mut self, connection: u32, frame: Value, audible: bool) {
        let kind = kind(&frame);
        let count = self.counts.entry(kind).or_default();
        *count += 1;
        let nth = *count;
        let robot = self.at(connection).robot;
        let outcome = match kind {
            Kind::Query => self.tell(robot, &frame),
            Kind::Command => self.command(robot, &frame),
            Kind::List => self.list(robot, &frame),
            Kind::Other => Outcome { did: Did::Nothing, reply: None },
        };
        let lost = self.character.lost.iter().any(|lost| (lost.kind, lost.nth) == (kind, nth));
        let reply = outcome.reply.filter(|_| audible && !lost).map(|(body, after)| {
            let at = self.now + after;
            self.at(connection).reply(at, enveloped(&frame, body));
            at
        });
        self.write(connection, frame, kind, outcome.did, reply);
    }

    fn tell(&self, robot: usize, frame: &Value) -> Outcome {
        let asked = frame["queryAddr"].as_array().cloned().unwrap_or_default();
        let known = asked.iter().filter_map(Value::as_str);
        let values: Vec<_> =
            known.filter_map(|address| value(&self.bodies[robot], &self.character, address)).collect();
        let body = json!({ "queryAddr": asked, "queryData": values });
        Outcome { did: Did::Told, reply: Some((body, self.character.delays.query)) }
    }

    fn command(&mut self, robot: usize, frame: &Value) -> Outcome {
        let word = frame["cmdData"][0].as_str().unwrap_or_default();
        let stops = &self.character.stops;
        let delay = self.character.delays.command;
        let by_stop = |reaction: Reaction| (reaction, Due::Halt { robot, reaction });
        let (reaction, due) = match word {
            "actionStop" => by_stop(stops.action_stop),
            "stopButton" => by_stop(stops.stop_button),
            "actionPause" => by_stop(stops.action_pause),
            word => {
                let obeyed = self.bodies[robot].obey(word);
                let did = if obeyed { Did::Obeyed } else { Did::Refused };
                return Outcome { did, reply: Some((verdict(word, obeyed), delay)) };
            }
        };
        let did = self.react(robot, reaction, due, Did::Halts);
        Outcome { did, reply: reaction.effect.answer().map(|ok| (verdict(word, ok), delay)) }
    }

    /// Applies the effect of a way of stopping, now or later.
    fn react(&mut self, robot: usize, reaction: Reaction, due: Due, done: Did) -> Did {
        if reaction.effect.works() {
            self.agenda.put(self.now + reaction.takes, due);
            self.advance(self.now);
            return done;
        }
        if reaction.effect.answer().is_some() {
            self.bodies[robot].show(&reaction);
        }
        if reaction.effect.answer() == Some(false) { Did::Refused } else { Did::Nothing }
    }

    fn list(&mut self, robot: usize, frame: &Value) -> Outcome {
        let replace = matches!(frame["emptyList"].as_str(), Some("1"));
        let instructions = frame["instructions"].as_array().cloned().unwrap_or_default();
        let delay = self.character.delays.list;
        let answer = |ok| Some((verdict("AddRCC", ok), delay));
        if instructions.is_empty() {
            let reaction = self.character.stops.clear;
            if !replace {
                return Outcome { did: Did::Nothing, reply: answer(true) };
            }
            let did = self.react(robot, reaction, Due::Clear { robot, reaction }, Did::Cleared);
            return Outcome { did, reply: reaction.effect.answer().and_then(answer) };
        }
        if !self.takes_lists(robot) {
            return Outcome { did: Did::Refused, reply: answer(false) };
        }
        let steps = self.read_list(robot, &instructions);
        let dropped = steps.len() < instructions.len();
        self.lists_taken += 1;
        let nth = self.lists_taken;
        let late = self.character.late.iter().find(|late| late.nth.is_none_or(|which| which == nth)).copied();
        if let Some(Late { taken_after, answered_after, .. }) = late {
            self.agenda.put(self.now + taken_after, Due::Take { robot, replace, steps });
            let reply = answered_after.map(|after| (verdict("AddRCC", true), after));
            self.advance(self.now);
            return Outcome { did: Did::TakesLater, reply };
        }
        // If all instructions of a list were dropped, it does not even replace the present list.
        let taken = steps.is_empty() || self.bodies[robot].take(replace, steps);
        let did = match (taken, dropped) {
            (false, _) => Did::Refused,
            (true, true) => Did::Dropped,
            (true, false) => Did::Took,
        };
        Outcome { did, reply: answer(taken) }
    }

    /// Whether the present mode accepts lists. If the character does so, mode 2 changes to 7.
    fn takes_lists(&mut self, robot: usize) -> bool {
        let body = &mut self.bodies[robot];
        if body.mode == 2 && self.character.arms_itself && body.alarm == 0 {
            body.mode = 7;
        }
        body.mode == 7
    }

    /// The steps of a list that will be executed.
    pub(super) fn read_list(&mut self, robot: usize, instructions: &[Value]) -> Vec<Step> {
        if instructions.is_empty() {
            return Vec::new();
        }
        let body = &mut self.bodies[robot];
        body.lists += 1;
        let list = body.lists;
        let mut steps: Vec<_> =
            instructions.iter().zip(1..).map(|(step, place)| Step::read(list, place, step)).collect();
        match self.character.never_executed {
            None => {}
            Some(NeverExecuted::Always) => steps.clear(),
            Some(NeverExecuted::WithTool) => steps.retain(|step| !step.tool),
            Some(NeverExecuted::AfterWorkbench) => {
                let until = steps.iter().position(|step| step.act == Act::Workbench);
                steps.truncate(until.unwrap_or(steps.len()));
            }
        }
        steps
    }
}

impl Body {
    /// A command that is not a stop. Returns whether it was executed.
    fn obey(&mut self, word: &str) -> bool {
        match word {
            "startButton" => self.start(),
            "clearAlarm" | "clearAlarmRunNext" | "clearAlarmContinue" => {
                self.alarm = 0;
                true
            }
            // Accepted, but without effect on this machine.
            "modifyGSPD" | "modifyAccDec" | "switchTool" | "switchCoordinate" | "modifyTool"
            | "modifyOutput" | "modifyCounter" | "rewriteData" | "rewriteDataList" | "switchMold"
            | "modifyStackData" => true,
            _ => false,
        }
    }
}

/// The value of an address, as text; `None` for an unknown address.
fn value(body: &Body, character: &Character, address: &str) -> Option<Value> {
    let decimal = |value: f64| Some(Value::from(format!("{value:.6}")));
    if let Some(axis) = address.strip_prefix("axis-") {
        return decimal(*body.axes().get(axis.parse::<usize>().ok()?)?);
    }
    if let Some(axis) = address.strip_prefix("world-") {
        let axis: usize = axis.parse().ok()?;
        return decimal(body.axes().get(axis)? + WORLD_OFFSET.get(axis)?);
    }
    let text = match address {
        "version" => body.cabinet.version.clone(),
        "machineName" if body.cabinet.name_in_a_list => return Some(json!([body.cabinet.name])),
        "machineName" => body.cabinet.name.clone(),
        "axisNum" => body.cabinet.axis_count.min(AXES).to_string(),
        "curMode" => body.mode.to_string(),
        "curAlarm" => body.alarm.to_string(),
        "origin" => u8::from(body.homed).to_string(),
        "isMoving" => u8::from(body.moving()).to_string(),
        "curCycle" | "lastCycle" => "0.000".to_owned(),
        "RemoteCmdLen" => match character.list_length {
            ListLength::Absent => return None,
            ListLength::Zero => "0".to_owned(),
            ListLength::Unreadable => "24x".to_owned(),
            ListLength::True if body.dwelling() && character.dwell_told_empty => "0".to_owned(),
            ListLength::True => body.list_length().to_string(),
        },
        _ => return None,
    };
    Some(text.into())
}

fn verdict(word: &str, ok: bool) -> Value {
    json!({ "cmdReply": [word, if ok { "ok" } else { "err" }] })
}

/// A reply in the form of captured controllers: keys in alphabetical order, no byte after the brace, and
/// `dsID`, `packID` and type as in the request.
fn enveloped(request: &Value, mut body: Value) -> Vec<u8> {
    for key in ["dsID", "packID", "reqType", "cmdType"] {
        if let (Some(value), Some(reply)) = (request.get(key), body.as_object_mut()) {
            reply.insert(key.to_owned(), value.clone());
        }
    }
    body.to_string().into_bytes()
}
