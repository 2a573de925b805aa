//! Gives a request to the connection and waits for the answer.

use r6_proto::message::{Command, PhotoAnswer};

use crate::conditions::Conditions;
use crate::error::{Effect, OutcomeUnknown, RequestError, Sent};
use crate::evidence::About;
use crate::job::{Accepted, Answer, CameraSet, Job, Terms, Work};
use crate::link::Lane;
use crate::pushed::LostReason;
use crate::query::result::Rows;
use crate::reply::Reply;
use crate::robot::Robot;

impl Robot {
    /// Sends a command (manual 4.2). A stop or a pause overtakes everything that waits.
    ///
    /// # Errors
    /// [`RequestError`]. The client never resends it. Only stop and pause reconnect a lost connection.
    pub async fn command(&self, command: Command<'static>) -> Result<Accepted, RequestError> {
        self.drive(self.command_now(command)).await
    }

    /// Sends a command as [`Self::command`], but only under these conditions. A stop or a pause leaves under
    /// any condition.
    ///
    /// # Errors
    /// As [`Self::command`], and the errors that [`Conditions`] names.
    pub async fn command_under(
        &self,
        conditions: Conditions,
        command: Command<'static>,
    ) -> Result<Accepted, RequestError> {
        if command.name().effect() == Effect::Stops {
            return self.command(command).await;
        }
        let terms = self.terms(conditions);
        self.drive(self.command_on(terms, command)).await
    }

    pub(crate) async fn command_now(&self, command: Command<'static>) -> Result<Accepted, RequestError> {
        self.command_on(Terms::default(), command).await
    }

    async fn command_on(&self, terms: Terms, command: Command<'static>) -> Result<Accepted, RequestError> {
        let changes_frame = command.name().info().changes_frame;
        let work = Work::Command(command);
        let lane = match work.sent().effect {
            Effect::Stops => {
                self.announce_stop();
                Lane::Urgent
            }
            Effect::Reads | Effect::Changes | Effect::Moves => Lane::Ordinary,
        };
        // A checked list is sent before the frame changes, or is checked again after that.
        let _turn = if changes_frame { Some(self.lists().await) } else { None };
        self.accepted_on(terms, work, lane).await
    }

    /// Sends the points that cameras found (manual 5.2); [`Accepted::points`] tells how many were accepted.
    ///
    /// # Errors
    /// [`RequestError`]. The client never resends it, because a program may wait for these points to move.
    pub async fn add_points(&self, cameras: Vec<CameraSet>) -> Result<Accepted, RequestError> {
        self.drive(self.accepted(Work::AddPoints(cameras), Lane::Ordinary)).await
    }

    /// Sends points as [`Self::add_points`], but only under these conditions. Points that do not fit into a
    /// frame are not sent ([`crate::Invalid::TooLong`]).
    ///
    /// # Errors
    /// As [`Self::add_points`], and the errors that [`Conditions`] names.
    pub async fn add_points_under(
        &self,
        conditions: Conditions,
        cameras: Vec<CameraSet>,
    ) -> Result<Accepted, RequestError> {
        self.check_points(&cameras)?;
        let terms = self.terms(conditions);
        self.drive(self.accepted_on(terms, Work::AddPoints(cameras), Lane::Ordinary)).await
    }

    /// Answers a photo request as [`Self::answer_photo`], but only under these conditions. They are checked
    /// when the answer is given to the connection. Unlike a command, it is not taken back if the socket takes
    /// no bytes then and the permission is withdrawn meanwhile.
    ///
    /// # Errors
    /// As [`Self::answer_photo`], and the errors that [`Conditions`] names.
    pub async fn answer_photo_under(
        &self,
        conditions: Conditions,
        answer: PhotoAnswer,
    ) -> Result<(), RequestError> {
        let terms = self.terms(conditions);
        self.drive(self.ask_on(terms, Work::PhotoAnswer(answer), Lane::Ordinary)).await.map(|_left| ())
    }

    /// These conditions, from now on.
    fn terms(&self, conditions: Conditions) -> Terms {
        let Conditions { leave_within, only_on, permission } = conditions;
        let leave_by = leave_within.map(|within| self.now() + within);
        Terms { leave_by, only_on, permission, ..Terms::default() }
    }

    /// Answers a photo request (manual 5.1). The controller does not reply: `Ok` means that the answer was
    /// sent.
    ///
    /// # Errors
    /// [`RequestError::NotSent`], or [`RequestError::OutcomeUnknown`] if the connection ended within the
    /// frame.
    pub async fn answer_photo(&self, answer: PhotoAnswer) -> Result<(), RequestError> {
        self.drive(self.ask(Work::PhotoAnswer(answer), Lane::Ordinary)).await.map(|_left| ())
    }

    /// Sends a request that the controller accepts or refuses.
    pub(crate) async fn accepted(&self, work: Work, lane: Lane) -> Result<Accepted, RequestError> {
        self.accepted_on(Terms::default(), work, lane).await
    }

    /// Sends such a request on these terms only. Otherwise it is refused: too late as
    /// [`crate::NotSent::Busy`], on another connection as [`crate::NotSent::Disconnected`].
    pub(crate) async fn accepted_on(
        &self,
        terms: Terms,
        work: Work,
        lane: Lane,
    ) -> Result<Accepted, RequestError> {
        let request = work.sent();
        let is_list = matches!(work, Work::AddRcc { .. });
        let leaving = self.common.tell.leaving(&work);
        let answer = self.ask_on(terms, work, lane).await;
        leaving.answered(&answer);
        match answer? {
            Answer::Accepted { accepted, on } => {
                if request.effect == Effect::Moves {
                    let robot = self.hub().identity_on(on.connection);
                    self.motions().accepted(About { connection: on.connection, robot }, is_list);
                }
                Ok(accepted)
            }
            Answer::Values { .. } | Answer::Mismatch { .. } | Answer::Raw { .. } | Answer::Left => {
                Err(OutcomeUnknown::Unclear { request, answer: "a reply to a query".to_owned() }.into())
            }
        }
    }

    /// Gives a request to the connection and waits for its answer.
    pub(crate) async fn ask(&self, work: Work, lane: Lane) -> Result<Answer, RequestError> {
        self.ask_on(Terms::default(), work, lane).await
    }

    async fn ask_on(&self, terms: Terms, work: Work, lane: Lane) -> Result<Answer, RequestError> {
        self.answered(self.give(terms, work, lane)).await
    }

    /// Gives a query to the connection and waits for its answer. The values go into `room`.
    pub(crate) async fn ask_into(&self, room: Rows, work: Work, lane: Lane) -> Result<Answer, RequestError> {
        self.answered(self.give_with_room(room, Terms::default(), work, lane)).await
    }

    async fn answered(&self, mut given: Given) -> Result<Answer, RequestError> {
        let answer = given.answer().await;
        self.hub().places.put_back(given.reply);
        answer
    }

    /// Gives a request to the connection. Requests of the same lane are sent in the order in which they are
    /// given.
    pub(crate) fn give(&self, terms: Terms, work: Work, lane: Lane) -> Given {
        self.give_with_room(Rows::new(), terms, work, lane)
    }

    fn give_with_room(&self, room: Rows, terms: Terms, work: Work, lane: Lane) -> Given {
        let request = work.sent();
        let asked_at = self.hub().time.now();
        let (to, reply) = self.hub().places.open();
        let mut job = Job::new(work, asked_at, to);
        job.rows = room;
        (job.leave_by, job.only_on) = (terms.leave_by, terms.only_on);
        job.permission = terms.permission;
        job.stops_before = terms.stops_before.unwrap_or_else(|| self.hub().stops_asked());
        job.background = lane == Lane::Background;
        self.common.shared.connection().give(lane, job);
        Given { request, reply }
    }
}

/// A request that was given to the connection.
#[derive(Debug)]
pub(crate) struct Given {
    request: Sent,
    reply: Reply,
}

impl Given {
    /// Waits for the answer to the request.
    pub async fn answer(&mut self) -> Result<Answer, RequestError> {
        // The connection answers every request, unless its runtime was shut down and nothing drives it any
        // more.
        let reason = LostReason::ClosedHere;
        let ended = OutcomeUnknown::ConnectionLost { request: self.request, reason };
        (&mut self.reply).await.unwrap_or(Err(ended.into()))
    }
}
