//! The camera's side: answers photo requests and sends the points found, on the robot's own connection.
//!
//! A closure gets each photo request. The answer is sent on the connection on which the request came, or not
//! at all.

use std::fmt;

use r6_proto::message::{PhotoAnswer, Point};
use r6_proto::request::{CameraPoints, Request};
use tokio::sync::broadcast::error::RecvError;

use crate::error::{Invalid, RequestError};
use crate::job::{CameraSet, Work};
use crate::link::Lane;
use crate::pushed::{LostReason, Pushed};
use crate::robot::Robot;
use crate::settings::LONGEST_PACK_ID;

/// Result of a request for a photo.
#[derive(Clone, Debug, PartialEq)]
pub enum Shot {
    /// The picture was taken, and these parts are in it; perhaps none.
    Points(Vec<Point>),
    /// There is no picture. The request is answered with `ret` 0, and the program decides how to continue.
    Failed,
    /// Another program acts as this camera: nothing is sent.
    NotMine,
}

/// Why photos are no longer served.
#[derive(Clone, Debug, PartialEq)]
pub enum PhotosEnded {
    /// The connection ended, and requests arrive no longer. Look at the machine ([`Robot::status`], which
    /// reconnects), then serve again. Points of a picture that was requested before are not sent any more.
    ConnectionLost(LostReason),
    /// A handle of this connection sent a stop or a pause while a picture was under way. Its points, and
    /// those of later pictures, are held back, because they could set the arm in motion again. Look at the
    /// machine, then serve again.
    ///
    /// An answer or points that were sent before the stop are not recalled.
    Stopped,
    /// The handle was closed.
    Closed,
    /// Another call already serves the photos of this connection, over this handle or a clone; both would
    /// answer each request. Nothing was sent.
    ServedAlready,
    /// An answer was not sent, or the controller did not take the points. If points cannot be sent
    /// ([`RequestError::Invalid`]: not a number, or too many for a frame), their request gets no answer,
    /// because `ret` 1 would promise them.
    Request {
        /// The camera.
        cam_id: i64,
        /// Why.
        error: RequestError,
    },
    /// Events were missed while a picture was processed: photo requests may be among them.
    FellBehind {
        /// How many.
        missed: u64,
    },
}

impl Robot {
    /// Acts as the camera of this controller from now on: passes each photo request (manual 5.1) to `look`,
    /// with its `camID`. Then it checks the points, answers the request and, if parts were found, sends their
    /// points (manual 5.2).
    ///
    /// It returns only when it cannot continue, and it sends nothing again that failed. A connection has one
    /// camera service: a second one returns at once ([`PhotosEnded::ServedAlready`]). Requests are served one
    /// after the other, in order. The program on the controller limits how long it waits for the answer (on
    /// the virtual controller with the `limit` of its step). If finding parts takes longer than taking the
    /// picture, use [`Robot::pushed`], [`Robot::answer_photo`] and [`Robot::add_points`] instead.
    ///
    /// Points can set the arm in motion, and no guard checks them. None are sent after a stop or a pause of
    /// this connection that came while their picture was under way ([`PhotosEnded::Stopped`]). Requests from
    /// before this call are not seen.
    pub async fn serve_photos<F, Fut>(&self, look: F) -> PhotosEnded
    where
        F: FnMut(i64) -> Fut,
        Fut: Future<Output = Shot>,
    {
        self.drive(self.serve(look)).await
    }

    pub(crate) async fn serve<F, Fut>(&self, mut look: F) -> PhotosEnded
    where
        F: FnMut(i64) -> Fut,
        Fut: Future<Output = Shot>,
    {
        let Some(_turn) = self.photos() else { return PhotosEnded::ServedAlready };
        // Read this before listening: a request on an earlier connection is not answered on a later one.
        let connection = self.hub().known().connection;
        let same = || self.hub().known().connection == connection;
        let mut pushed = self.pushed();
        let mut stops = self.stops();
        // The number of pending events that are older than a stop.
        let mut overtaken = 0_usize;
        loop {
            let event = tokio::select! {
                biased;
                () = self.closed() => return PhotosEnded::Closed,
                // This handle keeps the sender alive.
                _stopped = stops.changed() => {
                    overtaken = pushed.len();
                    continue;
                }
                event = pushed.recv() => event,
            };
            let is_overtaken = overtaken > 0;
            overtaken = overtaken.saturating_sub(1);
            match event {
                Ok(Pushed::Photo { .. }) if is_overtaken && same() => return PhotosEnded::Stopped,
                Ok(Pushed::Photo { cam_id }) if same() => {
                    let since = stops.clone();
                    let stopped = || since.has_changed().unwrap_or(true);
                    let serving = async {
                        let shot = look(cam_id).await;
                        self.answer_shot(cam_id, shot, || same() && !stopped()).await
                    };
                    let served = tokio::select! {
                        biased;
                        _stopped = stops.changed() => return PhotosEnded::Stopped,
                        served = serving => served,
                    };
                    match served {
                        _ if stopped() => return PhotosEnded::Stopped,
                        Ok(()) => {}
                        Err(error) => return PhotosEnded::Request { cam_id, error },
                    }
                }
                Ok(Pushed::ConnectionLost(reason)) => return PhotosEnded::ConnectionLost(reason),
                Ok(
                    Pushed::Photo { .. }
                    | Pushed::Stray { .. }
                    | Pushed::BadFrame(_)
                    | Pushed::NotJson(_)
                    | Pushed::Reconnected(_),
                ) => {}
                Err(RecvError::Lagged(missed)) => return PhotosEnded::FellBehind { missed },
                Err(RecvError::Closed) => return PhotosEnded::Closed,
            }
        }
    }

    /// Answers, and sends the points, each only if `may` allows it at that moment. Points that cannot be sent
    /// are not promised.
    async fn answer_shot(&self, cam_id: i64, shot: Shot, may: impl Fn() -> bool) -> Result<(), RequestError> {
        let (ret, points) = match shot {
            Shot::NotMine => return Ok(()),
            Shot::Failed => (0, Vec::new()),
            Shot::Points(points) => (1, points),
        };
        let sets = [CameraSet { cam_id, points }];
        self.check_points(&sets)?;
        let [set] = sets;
        if may() {
            self.ask(Work::PhotoAnswer(PhotoAnswer { cam_id, ret }), Lane::Ordinary).await?;
        }
        if !set.points.is_empty() && may() {
            self.accepted(Work::AddPoints(vec![set]), Lane::Ordinary).await?;
        }
        Ok(())
    }

    /// Whether these points can be sent: each number can, and all of them fit into a frame with any `packID`.
    ///
    /// # Errors
    /// [`Invalid::Value`], [`Invalid::TooLong`].
    pub fn check_points(&self, sets: &[CameraSet]) -> Result<(), Invalid> {
        let settings = self.settings();
        let points: Vec<_> =
            sets.iter().map(|set| CameraPoints { cam_id: set.cam_id, points: &set.points }).collect();
        let mut frame = Vec::new();
        let addressing = settings.addressing(LONGEST_PACK_ID);
        Request::AddPoints(&points).encode(&addressing, &mut frame).map_err(Invalid::Value)?;
        let (bytes, limit) = (frame.len(), settings.max_frame_bytes);
        if bytes > limit { Err(Invalid::TooLong { bytes, limit }) } else { Ok(()) }
    }
}

impl fmt::Display for PhotosEnded {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("photos are no longer served: ")?;
        match self {
            Self::ConnectionLost(reason) => write!(
                f,
                "the connection is lost ({reason}); read the status, which connects anew, then serve again"
            ),
            Self::Stopped => f.write_str(
                "a stop or a pause was sent over this connection while a picture was under way; look at the machine, then \
                 serve again",
            ),
            Self::Closed => f.write_str("the handle is closed"),
            Self::ServedAlready => f.write_str(
                "the photos of this connection are served already, and two would both answer; end the other service first",
            ),
            Self::Request { cam_id, error } => write!(f, "camera {cam_id}: {error}"),
            Self::FellBehind { missed } => write!(
                f,
                "{missed} events were missed while a picture was looked at, and requests may be among them; serve again"
            ),
        }
    }
}

impl std::error::Error for PhotosEnded {}
