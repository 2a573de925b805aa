//! Where the messages of one connection are dealt with.

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
use super::scenario::{Asked, Strikes};
use crate::answer::Answers;
use crate::fault::IgnoredStop;
use crate::log::{Level, Log};
use crate::machine::{Machine, NotTaken};
use crate::profile::{MissingOneshot, PathSpeedAnswer, Profile};
use crate::scenario::LateList;

/// How many oddities of one message are explained, each with its nearest right word.
const MAX_EXPLAINED: usize = 8;

/// Where the messages of one connection are dealt with.
pub(super) struct Desk<'c> {
    pub now: Instant,
    pub id: ConnectionId,
    pub machine: &'c mut Machine,
    pub log: &'c mut Log,
    pub cameras: &'c mut Cameras,
    /// The connection has to be reset.
    pub reset: bool,
    /// What is wrong with this request.
    pub strikes: Strikes,
    /// Whose values queries get, while they are frozen.
    pub frozen: Option<&'c Machine>,
    /// Where the request is noted down, for whoever wants to know it.
    pub asked: Option<Asked>,
    /// A list that is taken later, and when.
    pub late: Option<(Instant, LateList)>,
}

impl<'c> Desk<'c> {
    /// A desk where nothing is wrong.
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
            strikes: Strikes::default(),
            frozen: None,
            asked: None,
            late: None,
        }
    }

    /// Deals with the next message that is complete; false if there is none.
    pub fn serve_next(&mut self, inbox: &mut Inbox, outbox: &mut Outbox) -> bool {
        match inbox.next_message() {
            Some(Ok(message)) => self.handle(&message, outbox),
            Some(Err(error)) => self.malformed(&error),
            None => return false,
        }
        true
    }

    /// Logs what is odd about a message: the first few with the nearest right word, the rest by their number. A hostile
    /// peer can put thousands of wrong words into one frame, and each explanation costs a search.
    fn explain(&mut self, oddities: impl Iterator<Item = impl std::fmt::Display>) {
        let mut oddities = oddities;
        for oddity in oddities.by_ref().take(MAX_EXPLAINED) {
            self.warn(oddity.to_string());
        }
        match oddities.count() {
            0 => {}
            more => self.warn(format!("and {more} more of the kind")),
        }
    }

    fn info(&mut self, text: String) {
        self.log.add(self.now, Some(self.id), Level::Info, text);
    }

    fn warn(&mut self, text: String) {
        self.log.warn(self.now, self.id, text);
    }

    /// Malformed input gets silence and a log line.
    fn malformed(&mut self, error: &InputError) {
        self.warn(format!("{error}; not answered"));
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
                self.info(format!("camera {} answers: ret {}", answer.cam_id, answer.ret));
                self.machine.photo_answered(answer.cam_id, answer.ret == 1);
            }
            Body::AddPoints(points) => self.add_points(header, points, outbox),
            Body::AddRcc(list) => self.add_rcc(message, list, outbox),
            Body::Rejected(rejection) => self.rejected(message, rejection, outbox),
            Body::Unknown(unknown) => self.warn(format!("{unknown}; not answered")),
            Body::QueryReply(_) | Body::CommandReply(_) | Body::Photo(_) => {
                self.warn("a reply came, but a controller asks nothing; not answered".to_owned());
            }
        }
    }

    /// Tells of a `dsID` that is not the one of such a request, once for each connection. What real controllers do with it is not known:
    /// the request is dealt with as any other.
    fn check_ds_id(&mut self, header: &Header<'_>, request: RequestType) {
        let right = [DsIdForm::Long, DsIdForm::Short].map(|form| form.ds_id(request));
        let sent = header.ds_id.map(|sent| sent.text());
        if sent.as_ref().is_some_and(|sent| right.iter().any(|right| *right == &**sent)) {
            return;
        }
        if !self.log.is_first_ds_id(self.id) {
            return;
        }
        let sent = header
            .ds_id
            .map_or_else(|| "no `dsID`".to_owned(), |sent| format!("`dsID` is `{}`", sent.text()));
        let [long, short] = right;
        let right = if long == short { format!("`{long}`") } else { format!("`{long}` or `{short}`") };
        self.warn(format!(
            "{request}: {sent}, and should be {right}: a real controller may not answer; not told again on this connection"
        ));
    }

    /// Lets `write` append a reply, unless the request had no type (manual 5.2, 6: no reply without it). Then the log says so, and
    /// with `done` that the request was carried out all the same.
    fn reply(
        &mut self,
        header: &Header<'_>,
        request: RequestType,
        done: bool,
        outbox: &mut Outbox,
        write: impl FnOnce(&ReplyWriter<'_>, &Machine, &mut Vec<u8>),
    ) {
        if header.type_word.is_none() {
            let what = if done { "carried out, not answered" } else { "not answered" };
            self.warn(format!("{request} without `reqType`: {what}"));
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
                let arguments = words.arguments().iter().map(|argument| argument.text());
                let said: Vec<_> = std::iter::once(word.clone()).chain(arguments).collect();
                self.info(said.join(" ") + self.not_done());
                self.verdict(header, RequestType::Command, &word, Verdict::Ok, outbox);
            }
            Err(reason) => {
                self.warn(format!("command {word} refused: {reason}"));
                self.verdict(header, RequestType::Command, &word, Verdict::Err(&reason), outbox);
            }
        }
    }

    /// A stop is answered, and the arm goes on.
    fn ignore(
        &mut self,
        header: &Header<'_>,
        request: RequestType,
        word: &str,
        how: IgnoredStop,
        outbox: &mut Outbox,
    ) {
        let (told, verdict) = match how {
            IgnoredStop::Err => ("err", Verdict::BareErr),
            IgnoredStop::Ok | IgnoredStop::Every => ("ok", Verdict::Ok),
        };
        self.info(format!("{word}: answered {told} and not carried out (fault stop-ignored)"));
        self.verdict(header, request, word, verdict, outbox);
    }

    fn heartbreak(&mut self, header: &Header<'_>, outbox: &mut Outbox) {
        self.machine.watchdog.feed(self.now);
        if self.machine.profile.answers_heartbreak {
            self.verdict(header, RequestType::Heartbreak, "heartbreak", Verdict::Ok, outbox);
        }
    }

    /// This connection is a camera's.
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
                self.warn(format!("AddRCC refused: action {} is not known", unknown.number()));
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
            self.info(format!("a list is taken {delay:?} later, and not answered: fault late-list"));
            return;
        }
        let steps = self.with_oneshot(list);
        let verdict = match self.take_instructions(list.empty_list.unwrap_or(false), &steps) {
            Ok(()) if self.answers_err_to(&steps) => {
                let count = steps.len();
                self.warn(format!(
                    "AddRCC: {count} instructions answered err, and executed: a linear move stands behind a path speed (actions 51, \
                     10), as reported of one unit"
                ));
                Verdict::BareErr
            }
            Ok(()) => {
                let how = if list.empty_list == Some(true) { "replaced" } else { "appended to" };
                let count = match list.instructions.len() {
                    1 => "1 instruction".to_owned(),
                    count => format!("{count} instructions"),
                };
                self.info(format!("AddRCC: {count}, list {how}{}", self.not_done()));
                Verdict::Ok
            }
            Err(NotTaken::Refused(reason)) => {
                self.warn(format!("AddRCC refused: {reason}"));
                Verdict::BareErr
            }
            Err(NotTaken::Silent(reason)) => {
                self.warn(format!("AddRCC neither executed nor answered: {reason}"));
                return;
            }
        };
        self.verdict(&message.header, RequestType::AddRcc, "AddRCC", verdict, outbox);
    }

    /// The instructions, with what this firmware takes one without `oneshot` for.
    fn with_oneshot<'l>(&mut self, list: &AddRcc<'l>) -> Cow<'l, [Instruction]> {
        let mut steps = Cow::Borrowed(list.instructions);
        let numbers = list.without_oneshot.iter().map(|index| index + 1);
        let (is_oneshot, taken) = match self.machine.profile.oneshot_missing {
            MissingOneshot::Keep => (false, "0: it stays, and the list runs again and again"),
            MissingOneshot::Remove => (true, "1: it is removed once it has run"),
        };
        self.explain(
            numbers.map(|number| format!("instruction {number} has no `oneshot`: taken as {taken}")),
        );
        for index in list.without_oneshot {
            let index = usize::try_from(*index).unwrap_or(usize::MAX);
            if let Some(step) = steps.to_mut().get_mut(index) {
                step.oneshot = is_oneshot;
            }
        }
        steps
    }

    /// Whether a list that was taken is answered with `err` all the same.
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

    /// What the log says besides of something that was answered with ok.
    fn not_done(&self) -> &'static str {
        if self.strikes.not_executed { ": answered ok and not carried out (fault not-executed)" } else { "" }
    }

    fn take_instructions(&mut self, replace: bool, steps: &[Instruction]) -> Result<(), NotTaken> {
        if self.strikes.not_executed {
            return Ok(());
        }
        if self.strikes.list_full && !steps.is_empty() {
            return Err(NotTaken::Refused("the instruction list is full"));
        }
        if self.strikes.rejected_mid_batch && !steps.is_empty() {
            let half = steps.get(..steps.len() / 2).unwrap_or_default();
            if !half.is_empty() {
                self.machine.add_instructions(replace, half)?;
            }
            return Err(NotTaken::Refused("an instruction in the middle of the list was not taken"));
        }
        self.machine.add_instructions(replace, steps)
    }

    /// Whether an AddRCC is short enough to be looked at at all.
    fn fits(&mut self, message: &Message<'_>) -> bool {
        let bytes = message.frame().len();
        let profile = &self.machine.profile;
        let over = |limit: Option<usize>| limit.is_some_and(|limit| bytes > limit);
        if over(profile.add_rcc_reset_over) {
            self.reset = true;
            self.warn(format!("AddRCC of {bytes} bytes: the connection is reset, as real controllers do"));
            return false;
        }
        if over(profile.add_rcc_silent_over) {
            self.warn(format!(
                "AddRCC of {bytes} bytes: neither executed nor answered, as real controllers do; send fewer \
                 instructions in one list and append the rest"
            ));
            return false;
        }
        true
    }

    /// A known type with a wrong field: what the protocol lets us say is `err`.
    fn rejected(&mut self, message: &Message<'_>, rejection: &Rejection<'_>, outbox: &mut Outbox) {
        let reason = rejection.error.to_string();
        self.warn(format!("{} refused: {reason}", rejection.request));
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

/// What a message asks for; `None` for what is no request.
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
