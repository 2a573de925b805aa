//! The camera's side: photo requests are answered, and the points that were found pushed, on the robot's own connection.

use std::fmt;

use r6_proto::message::{PhotoAnswer, Point};
use tokio::sync::broadcast::error::RecvError;

use crate::error::RequestError;
use crate::job::CameraSet;
use crate::pushed::{LostReason, Pushed};
use crate::robot::Robot;

/// What came of a request for a photo.
#[derive(Clone, Debug, PartialEq)]
pub enum Shot {
    /// The picture was taken, and these parts are in it; perhaps none.
    Points(Vec<Point>),
    /// There is no picture. The request is answered with `ret` 0; what the program then does is up to it.
    Failed,
    /// Another program is this camera: nothing is sent.
    NotMine,
}

/// Why photos are no longer served.
#[derive(Clone, Debug, PartialEq)]
pub enum PhotosEnded {
    /// The connection ended, and requests reach nobody. Look at the machine ([`Robot::status`], which connects anew), then serve
    /// again. Points of a picture that was asked for before are not sent any more.
    ConnectionLost(LostReason),
    /// The handle was closed.
    Closed,
    /// An answer did not leave, or the controller did not take the points.
    Request {
        /// The camera.
        cam_id: i64,
        /// Why.
        error: RequestError,
    },
    /// So many events were missed while a picture was looked at: photo requests may be among them.
    FellBehind {
        /// How many.
        missed: u64,
    },
}

impl Robot {
    /// Is the camera of this controller from now on: each photo request (manual 5.1) is handed to `look`, with its `camID`; then
    /// the request is answered and, if parts were found, their points are sent (manual 5.2).
    ///
    /// It ends only when it cannot go on, and nothing that failed is sent again. Requests are served one after the other, in their
    /// order. A program waits for the answer for a time of its own (on the virtual controller the `limit` of its step): where finding takes
    /// longer than taking the picture, use [`Robot::pushed`], [`Robot::answer_photo`] and [`Robot::add_points`] instead.
    ///
    /// Points can set the arm in motion, and no guard checks them. Requests that come before this is called are not seen.
    pub async fn serve_photos<F, Fut>(&self, mut look: F) -> PhotosEnded
    where
        F: FnMut(i64) -> Fut,
        Fut: Future<Output = Shot>,
    {
        // Read before listening: what was asked for on an earlier connection is not answered on a later one.
        let connection = self.hub().known().connection;
        let same = || self.hub().known().connection == connection;
        let mut pushed = self.pushed();
        loop {
            let event = tokio::select! {
                event = pushed.recv() => event,
                () = self.closed() => return PhotosEnded::Closed,
            };
            match event {
                Ok(Pushed::Photo { cam_id }) if same() => {
                    let shot = look(cam_id).await;
                    if same()
                        && let Err(error) = self.answer_shot(cam_id, shot).await
                    {
                        return PhotosEnded::Request { cam_id, error };
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

    async fn answer_shot(&self, cam_id: i64, shot: Shot) -> Result<(), RequestError> {
        let points = match shot {
            Shot::NotMine => return Ok(()),
            Shot::Failed => return self.answer_photo(PhotoAnswer { cam_id, ret: 0 }).await,
            Shot::Points(points) => points,
        };
        self.answer_photo(PhotoAnswer { cam_id, ret: 1 }).await?;
        if !points.is_empty() {
            self.add_points(vec![CameraSet { cam_id, points }]).await?;
        }
        Ok(())
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
            Self::Closed => f.write_str("the handle is closed"),
            Self::Request { cam_id, error } => write!(f, "camera {cam_id}: {error}"),
            Self::FellBehind { missed } => write!(
                f,
                "{missed} events were missed while a picture was looked at, and requests may be among them; serve again"
            ),
        }
    }
}

impl std::error::Error for PhotosEnded {}
