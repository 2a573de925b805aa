//! Handles the messages of one connection.

use std::borrow::Cow;

use r6_proto::RequestType;
use r6_proto::dialect::DsIdForm;
use r6_proto::message::{
    Action, AddPoints, AddRcc, Body, CommandWords, Header, Instruction, Message, Query, Rejection,
};
use r6_proto::reply::{ReplyWriter, Verdict};
use r6_proto::server::{Inbox, InputError, Outbox};
use r6_proto::time::Instant;

use super::ConnectionId;
use super::cameras::Cameras;
use super::scenario::{Asked, RequestFaults};
use crate::answer::Answers;
use crate::event::{Detail, Event, ListRefusal, Reason};
use crate::fault::IgnoredStop;
use crate::log::Log;
use crate::machine::{Machine, NotTaken};
use crate::profile::{MissingOneshot, PathSpeedAnswer, Profile};
use crate::scenario::LateList;

/// How many oddities of one message are explained, each with the nearest known word.
const MAX_EXPLAINED: usize = 8;

/// How many arguments of a command the log keeps. No command has more, and a line has no room for more.
const MAX_ARGUMENTS: usize = 104;

/// Handles the messages of one connection.
pub(super) struct Dispatcher<'c> {
    pub now: Instant,
    pub id: ConnectionId,
    pub machine: &'c mut Machine,
    pub log: &'c mut Log,
    pub cameras: &'c mut Cameras,
    /// The connection has to be reset.
    pub reset: bool,
    /// The faults that strike this request.
    pub strikes: RequestFaults,
    /// The frozen machine that queries read from, while the values are frozen.
    pub frozen: Option<&'c Machine>,
    /// Where to note the request, if the caller needs it.
    pub asked: Option<Asked>,
    /// A list that is taken later, and the time when it is taken.
    pub late: Option<(Instant, LateList)>,
}

impl<'c> Dispatcher<'c> {
    /// A dispatcher without faults.
    pub fn new(
        now: Instant,
        id: ConnectionId,
        machine: &'c mut Machine,
        log: &'c mut Log,
        cameras: &'c mut Cameras,
    ) -> Self {
        Self {
            now,
            id,
            machine,
            log,
            cameras,
            reset: false,
            strikes: RequestFaults::default(),
            frozen: None,
            asked: None,
            late: None,
        }
    }

    /// Handles the next complete message. Returns false if no message is complete.
    pub fn serve_next(&mut self, inbox: &mut Inbox, outbox: &mut Outbox) -> bool {
        match inbox.next_message() {
            Some(Ok(message)) => self.handle(&message, outbox),
            Some(Err(error)) => self.malformed(error),
            None => return false,
        }
        true
    }

    /// Logs the oddities of a message: the first few with the nearest known word, then only how many more
    /// there are. A hostile peer can put thousands of wrong words into one frame, and each explanation costs
    /// a search.
    fn explain(&mut self, oddities: impl Iterator<Item = impl Into<Reason>>) {
        let mut oddities = oddities;
        for oddity in oddities.by_ref().take(MAX_EXPLAINED) {
            self.warn(Event::Odd { problem: oddity.into() });
        }
        self.tell_of_more(oddities.count());
    }

    fn tell_of_more(&mut self, count: usize) {
        if count > 0 {
            self.warn(Event::MoreOfTheKind { count });
        }
    }

    fn info(&mut self, event: Event) {
        self.log.add(self.now, Some(self.id), event);
    }

    fn warn(&mut self, event: Event) {
        self.log.warn(self.now, self.id, event);
    }

    /// Logs malformed input. It gets no reply.
    fn malformed(&mut self, error: InputError) {
        self.warn(Event::NotUnderstood { problem: error.into() });
    }

    fn handle(&mut self, message: &Message<'_>, outbox: &mut Outbox) {
        self.explain(message.extras());
        if let Some(asked) = &mut self.asked {
            *asked = Asked { frame: message.frame().to_vec(), request: request_of(&message.body) };
        }
        let header = &message.header;
        if let Some(request) = request_of(&message.body) {
            self.check_ds_id(header, request);
        }
        if self.strikes.task_dead {
            if matches!(message.body, Body::Heartbreak) {
                self.machine.watchdog.feed(self.now);
                self.verdict(header, RequestType::Heartbreak, "heartbreak", Verdict::Ok, outbox);
            }
            return;
        }
        match &message.body {
            Body::Query(query) => self.query(header, query, outbox),
            Body::Command(words) => self.command(header, words, outbox),
            Body::Heartbreak => self.heartbreak(header, outbox),
            Body::PhotoAnswer(answer) => {
                self.speaks_as(answer.cam_id);
                self.info(Event::PhotoAnswered { camera: answer.cam_id, ret: answer.ret });
                self.machine.photo_answered(answer.cam_id, answer.ret == 1);
            }
            Body::AddPoints(points) => self.add_points(header, points, outbox),
            Body::AddRcc(list) => self.add_rcc(message, list, outbox),
            Body::Rejected(rejection) => self.rejected(message, rejection, outbox),
            Body::Unknown(unknown) => self.warn(Event::NotUnderstood { problem: (*unknown).into() }),
            Body::QueryReply(_) | Body::CommandReply(_) | Body::Photo(_) => {
                self.warn(Event::ReplyCame);
            }
        }
    }

    /// Warns of a `dsID` that does not belong to such a request, once per connection. How real controllers
    /// treat it is unknown, so the request is handled like any other.
    fn check_ds_id(&mut self, header: &Header<'_>, request: RequestType) {
        let right = [DsIdForm::Long, DsIdForm::Short].map(|form| form.ds_id(request));
        let sent = header.ds_id.map(|sent| sent.text());
        if sent.as_ref().is_some_and(|sent| right.iter().any(|right| *right == &**sent)) {
            return;
        }
        if !self.log.is_first_ds_id(self.id) {
            return;
        }
        let sent = header.ds_id.map(|sent| Detail::of(sent.text()));
        self.warn(Event::WrongDsId { request, sent, right });
    }

    /// Lets `write` append a reply, unless the request had no type (manual 5.2, 6: no reply without it).
    /// Without a type it logs a warning instead; `done` says whether the request was carried out all the
    /// same.
    fn reply(
        &mut self,
        header: &Header<'_>,
        request: RequestType,
        done: bool,
        outbox: &mut Outbox,
        write: impl FnOnce(&ReplyWriter<'_>, &Machine, &mut Vec<u8>),
    ) {
        if header.type_word.is_none() {
            self.warn(Event::WithoutType { request, done });
            return;
        }
        let writer = ReplyWriter::new(self.machine.profile.dialect, *header, request);
        let Profile { add_rcc_ack: ack, add_rcc_ack_spread: spread, .. } = self.machine.profile;
        let delay = (request == RequestType::AddRcc && !ack.is_zero())
            .then(|| self.machine.random.around(ack, spread));
        let machine = self.frozen.unwrap_or(self.machine);
        if let Some(delay) = delay {
            outbox.send_in_turn(self.now + delay, |out| write(&writer, machine, out));
        } else {
            outbox.send(|out| write(&writer, machine, out));
        }
    }

    fn verdict(
        &mut self,
        header: &Header<'_>,
        request: RequestType,
        word: &str,
        verdict: Verdict<'_>,
        outbox: &mut Outbox,
    ) {
        let done = match &verdict {
            Verdict::Ok | Verdict::Points(_) => !self.strikes.not_executed,
            Verdict::Err(_) | Verdict::BareErr => false,
        };
        self.reply(header, request, done, outbox, |writer, _, out| writer.verdict(word, verdict, out));
    }

    fn query(&mut self, header: &Header<'_>, query: &Query<'_>, outbox: &mut Outbox) {
        let mut known = 0;
        self.reply(header, RequestType::Query, false, outbox, |writer, machine, out| {
            let answers = Answers::of(machine);
            writer.query(query.addresses, out, |data| {
                for address in query.resolved().filter_map(|(_, address)| address.ok()) {
                    known += 1;
                    answers.append(address, data);
                }
            });
        });
        if known < query.addresses.len() {
            self.explain(query.resolved().filter_map(|(_, address)| address.err()));
        }
    }

    fn command(&mut self, header: &Header<'_>, words: &CommandWords<'_>, outbox: &mut Outbox) {
        let word = words.word();
        let ignored = self.strikes.stop_ignored.filter(|how| how.concerns(&word));
        if let Some(how) = ignored {
            return self.ignore(header, RequestType::Command, &word, how, outbox);
        }
        let done = if self.strikes.not_executed { Ok(()) } else { self.machine.execute(words) };
        match done {
            Ok(()) => {
                let arguments = words.arguments().iter().take(MAX_ARGUMENTS);
                let arguments = arguments.map(|argument| Detail::of(argument.text())).collect();
                let done = !self.strikes.not_executed;
                self.info(Event::CommandAccepted { command: Detail::of(&word), arguments, done });
                self.verdict(header, RequestType::Command, &word, Verdict::Ok, outbox);
            }
            Err(reason) => {
                let text = reason.to_string();
                self.warn(Event::CommandRefused { command: Detail::of(&word), why: reason });
                self.verdict(header, RequestType::Command, &word, Verdict::Err(&text), outbox);
            }
        }
    }

    /// Answers a stop without carrying it out: the arm keeps moving.
    fn ignore(
        &mut self,
        header: &Header<'_>,
        request: RequestType,
        word: &str,
        how: IgnoredStop,
        outbox: &mut Outbox,
    ) {
        let verdict = match how {
            IgnoredStop::Err => Verdict::BareErr,
            IgnoredStop::Ok | IgnoredStop::Every => Verdict::Ok,
        };
        self.info(Event::StopIgnored { request: Detail::of(word), how });
        self.verdict(header, request, word, verdict, outbox);
    }

    fn heartbreak(&mut self, header: &Header<'_>, outbox: &mut Outbox) {
        self.machine.watchdog.feed(self.now);
        if self.machine.profile.answers_heartbreak {
            self.verdict(header, RequestType::Heartbreak, "heartbreak", Verdict::Ok, outbox);
        }
    }

    /// Notes that this connection belongs to a camera.
    fn speaks_as(&mut self, cam_id: i64) {
        if let Some(oddity) = self.cameras.spoke(self.id, cam_id) {
            self.warn(oddity);
        }
    }

    fn add_points(&mut self, header: &Header<'_>, points: &AddPoints<'_>, outbox: &mut Outbox) {
        for (cam_id, points) in points.sets() {
            self.speaks_as(cam_id);
            self.machine.take_points(cam_id, points);
        }
        self.verdict(header, RequestType::AddPoints, "AddPoints", Verdict::Points(points.len()), outbox);
    }

    fn add_rcc(&mut self, message: &Message<'_>, list: &AddRcc<'_>, outbox: &mut Outbox) {
        if !self.fits(message) {
            return;
        }
        for step in list.instructions {
            if let Action::Unknown(unknown) = &step.action {
                self.warn(Event::ListRefused { why: ListRefusal::UnknownAction(unknown.number()) });
                self.verdict(&message.header, RequestType::AddRcc, "AddRCC", Verdict::BareErr, outbox);
                return;
            }
        }
        let clears = list.instructions.is_empty() && list.empty_list == Some(true);
        if clears && self.strikes.stop_ignored.is_some_and(|how| how.concerns("AddRCC")) {
            let how = IgnoredStop::Every;
            return self.ignore(&message.header, RequestType::AddRcc, "AddRCC", how, outbox);
        }
        if let Some(delay) = self.strikes.late_list.filter(|_| !list.instructions.is_empty()) {
            let (replace, steps) = (list.empty_list.unwrap_or(false), list.instructions.to_vec());
            self.late = Some((self.now + delay, LateList { replace, steps }));
            self.info(Event::ListComesLate { after: delay });
            return;
        }
        let steps = self.with_oneshot(list);
        let verdict = match self.take_instructions(list.empty_list.unwrap_or(false), &steps) {
            Ok(()) if self.answers_err_to(&steps) => {
                self.warn(Event::ListAnsweredErr { instructions: steps.len() });
                Verdict::BareErr
            }
            Ok(()) => {
                self.info(Event::ListTaken {
                    instructions: list.instructions.len(),
                    replaced: list.empty_list == Some(true),
                    done: !self.strikes.not_executed,
                });
                Verdict::Ok
            }
            Err(NotTaken::Refused(why)) => {
                self.warn(Event::ListRefused { why });
                Verdict::BareErr
            }
            Err(NotTaken::Silent(why)) => {
                self.warn(Event::ListIgnored { why });
                return;
            }
        };
        self.verdict(&message.header, RequestType::AddRcc, "AddRCC", verdict, outbox);
    }

    /// The instructions, with the `oneshot` that this firmware assumes where it is missing.
    fn with_oneshot<'l>(&mut self, list: &AddRcc<'l>) -> Cow<'l, [Instruction]> {
        let mut steps = Cow::Borrowed(list.instructions);
        let numbers = list.without_oneshot.iter().map(|index| index + 1);
        let is_oneshot = match self.machine.profile.oneshot_missing {
            MissingOneshot::Keep => false,
            MissingOneshot::Remove => true,
        };
        let mut numbers = numbers;
        for instruction in numbers.by_ref().take(MAX_EXPLAINED) {
            self.warn(Event::WithoutOneshot { instruction, stays: !is_oneshot });
        }
        self.tell_of_more(numbers.count());
        for index in list.without_oneshot {
            let index = usize::try_from(*index).unwrap_or(usize::MAX);
            if let Some(step) = steps.to_mut().get_mut(index) {
                step.oneshot = is_oneshot;
            }
        }
        steps
    }

    /// Whether a list that was taken is answered with `err` nevertheless.
    fn answers_err_to(&self, steps: &[Instruction]) -> bool {
        let is_line = |step: &Instruction| matches!(step.action, Action::LinearMove(_));
        let has_line_behind_path_speed = || {
            let mut rest = steps.iter().skip_while(|step| !matches!(step.action, Action::PathSpeed(_)));
            rest.any(is_line)
        };
        match self.machine.profile.path_speed_answer {
            PathSpeedAnswer::Ok => false,
            PathSpeedAnswer::Err => has_line_behind_path_speed(),
        }
    }

    fn take_instructions(&mut self, replace: bool, steps: &[Instruction]) -> Result<(), NotTaken> {
        if self.strikes.not_executed {
            return Ok(());
        }
        if self.strikes.list_full && !steps.is_empty() {
            return Err(NotTaken::Refused(ListRefusal::ListFull));
        }
        if self.strikes.rejected_mid_batch && !steps.is_empty() {
            let half = steps.get(..steps.len() / 2).unwrap_or_default();
            if !half.is_empty() {
                self.machine.add_instructions(replace, half)?;
            }
            return Err(NotTaken::Refused(ListRefusal::InTheMiddle));
        }
        self.machine.add_instructions(replace, steps)
    }

    /// Whether an AddRCC is short enough to be handled.
    fn fits(&mut self, message: &Message<'_>) -> bool {
        let bytes = message.frame().len();
        let profile = &self.machine.profile;
        let over = |limit: Option<usize>| limit.is_some_and(|limit| bytes > limit);
        if over(profile.add_rcc_reset_over) {
            self.reset = true;
            self.warn(Event::ListTooLong { bytes, reset: true });
            return false;
        }
        if over(profile.add_rcc_silent_over) {
            self.warn(Event::ListTooLong { bytes, reset: false });
            return false;
        }
        true
    }

    /// Refuses a request of a known type with a wrong field. The protocol only allows the answer `err`.
    fn rejected(&mut self, message: &Message<'_>, rejection: &Rejection<'_>, outbox: &mut Outbox) {
        let reason = rejection.error.to_string();
        self.warn(Event::Refused { request: rejection.request, why: rejection.error.clone().into() });
        let header = &message.header;
        match rejection.request {
            RequestType::AddRcc if !self.fits(message) => {}
            RequestType::AddRcc => {
                self.verdict(header, RequestType::AddRcc, "AddRCC", Verdict::BareErr, outbox);
            }
            RequestType::AddPoints => {
                self.verdict(header, RequestType::AddPoints, "AddPoints", Verdict::BareErr, outbox);
            }
            RequestType::Command => {
                self.verdict(header, RequestType::Command, "", Verdict::Err(&reason), outbox);
            }
            RequestType::Query => self.reply(header, RequestType::Query, false, outbox, |writer, _, out| {
                writer.query(r6_proto::value::Values::EMPTY, out, |_| {});
            }),
            RequestType::Heartbreak | RequestType::Photo => {}
        }
    }
}

/// The type of request of a message; `None` if it is not a request.
fn request_of(body: &Body<'_>) -> Option<RequestType> {
    match body {
        Body::Query(_) => Some(RequestType::Query),
        Body::Command(_) => Some(RequestType::Command),
        Body::Heartbreak => Some(RequestType::Heartbreak),
        Body::AddPoints(_) => Some(RequestType::AddPoints),
        Body::AddRcc(_) => Some(RequestType::AddRcc),
        Body::Rejected(rejection) => Some(rejection.request),
        Body::PhotoAnswer(_)
        | Body::Photo(_)
        | Body::QueryReply(_)
        | Body::CommandReply(_)
        | Body::Unknown(_) => None,
    }
}
