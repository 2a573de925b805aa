//! Cameras of a robot: standing grants, requests for photos, and what a camera sends.
//!
//! A camera needs no lease. Its token has a grant. The store has the grants, and is asked for each request:
//! so a grant counts as soon as it is given, and not any more once it is revoked, also by the command line or
//! over another gateway. All else is as for a command that moves: the seat gives a permit, the intent is on
//! the disk before anything leaves, and nothing is sent again.

use std::future::pending;

use r6_api::Code;
use r6_api::gateway::{CommandOutcome, Deed, Happened, PointsDone};
use r6_client::{Accepted, CameraSet, NotSent, Point, Pushed, RequestError, Robot};
use tokio::sync::SemaphorePermit;
use tokio::sync::broadcast::Receiver;
use tokio::sync::broadcast::error::RecvError;
use tracing::Instrument;

use super::command::{Told, outcome};
use super::photos::Photo;
use super::station::{Answers, By, Station};
use crate::core::camera::{Camera, CameraGrant, Standing};
use crate::core::live::flood::{Flood, Passage};
use crate::core::order::Order;
use crate::core::seat::{Asked, Denied};
use crate::problem::Problem;
use crate::store::{Author, NewGrant};
use crate::{clock, traces};

/// A request of a caller with a grant.
#[derive(Clone, Copy, Debug)]
pub struct Granted {
    standing: Standing,
    asked: Asked,
}

impl Station {
    /// The grants of its cameras.
    ///
    /// # Errors
    /// `store_unavailable`.
    pub async fn camera_grants(&self) -> Result<Vec<CameraGrant>, Problem> {
        let robot = self.robot_name().clone();
        let found = self.term.keeper.work(move |store| store.cameras(Some(&robot))).await?;
        Ok(found.into_iter().map(|(_, grant)| grant).collect())
    }

    /// Gives a token the grant for a camera. `false` if it has it.
    ///
    /// # Errors
    /// `no_such_token`, `bad_value` (the token is for another robot), `no_room`, `store_unavailable`.
    pub async fn grant_camera(&self, author: Author, camera: Camera, token: i64) -> Result<bool, Problem> {
        let new = NewGrant { robot: self.robot_name().clone(), camera, token };
        Ok(self.term.keeper.work(move |store| store.grant_camera(&new, &author)).await?)
    }

    /// Takes the grant for a camera from a token. What the token has asked for and has not left by now does
    /// not leave. `false` if it has none.
    ///
    /// # Errors
    /// `store_unavailable`.
    pub async fn revoke_camera(&self, author: Author, camera: Camera, token: i64) -> Result<bool, Problem> {
        let grant = NewGrant { robot: self.robot_name().clone(), camera, token };
        let revoked = self.term.keeper.work(move |store| store.revoke_camera(&grant, &author)).await;
        // Also if it failed: then the store may have done it.
        self.seat(|seat, _| seat.grant_is_revoked());
        Ok(revoked?)
    }

    /// Looks up the grant of a caller for a camera.
    ///
    /// # Errors
    /// `not_allowed`, `store_unavailable`.
    pub async fn granted(&self, by: &By, camera: Camera, token: Option<i64>) -> Result<Granted, Problem> {
        // Before the store is asked: a grant that is revoked meanwhile voids it.
        let asked = self.seat(|seat, now| seat.asked_by_camera(now));
        let standing = match token {
            Some(token) => Standing::of(&self.camera_grants().await?, camera, token),
            None => None,
        };
        standing.map(|standing| Granted { standing, asked }).ok_or_else(|| {
            let robot = self.name();
            let message = format!(
                "the caller has no grant to feed camera {camera} of {robot}: an admin gives one to a token \
                 (POST /v1/robots/{robot}/cameras/{camera}/grants)"
            );
            self.note_refused(by, &format!("camera {camera}"), Code::NotAllowed);
            Problem::new(Code::NotAllowed, message)
        })
    }

    /// The grant that a rule gives for a camera. `cameras` looks up its cameras as they are now.
    pub fn granted_by_rule(&self, camera: Camera, cameras: impl FnOnce() -> Vec<Camera>) -> Option<Granted> {
        // Before the rule is looked up: if the rules change meanwhile, it is void.
        let asked = self.seat(|seat, now| seat.asked_by_camera(now));
        Standing::of_rule(&cameras(), camera).map(|standing| Granted { standing, asked })
    }

    /// The cameras of which the controller asks for photos, from now on.
    pub fn photos(&self) -> Receiver<Camera> {
        self.cameras.asked.subscribe()
    }

    /// The cameras of which the controller asked for photos that can still be answered.
    pub fn open_photos(&self) -> Vec<Camera> {
        let now = self.of_photos_now();
        let photos = self.cameras.photos();
        photos.iter().filter(|(_, photo)| (photo.connection, photo.stops) == now).map(|(at, _)| *at).collect()
    }

    /// The connection and the number of stops of photos that can be answered now.
    fn of_photos_now(&self) -> (u64, u64) {
        self.seat(|seat, _| (seat.connection().unwrap_or_default(), seat.stops_begun()))
    }

    /// Sends the parts that a camera found. The intent is on the disk before they leave, the outcome after.
    ///
    /// # Errors
    /// `stopped`, `not_ready`, `identity_changed`, `run_under_way`, `bad_value`, `refused`, `overloaded`,
    /// `too_many_requests`, `store_unavailable`, `outcome_unknown`.
    pub async fn add_points(
        &self,
        by: &By,
        granted: Granted,
        points: Vec<Point>,
    ) -> Result<PointsDone, Problem> {
        let sent = points.len();
        let order = Order::Points { camera: granted.standing.camera(), points };
        let span = traces::of_command(self.name(), &order.to_string());
        let done = self.try_points(by, granted, order, sent).instrument(span).await;
        done.map_err(|told| self.refuse_camera(by, granted, "AddPoints", told))
    }

    async fn try_points(
        &self,
        by: &By,
        granted: Granted,
        order: Order,
        sent: usize,
    ) -> Result<PointsDone, (Problem, Told)> {
        let _slot = self.place().map_err(|problem| (problem, Told::No))?;
        let robot = self.check_camera(granted, &order).map_err(|problem| (problem, Told::No))?;
        let text = order.to_string();
        let send = self.send_of_camera(&robot, granted, order);
        // It is sent under no lease, also if there is one.
        let (command_id, accepted) = self.recorded(by, &text, 0, send).await?;
        let after_ms = clock::milliseconds(accepted.after);
        Ok(PointsDone { command_id, sent, taken: accepted.points, after_ms })
    }

    /// Answers the photo that the controller waits for. That it will be sent is on the disk before. No reply
    /// comes: `Ok` means that the answer left.
    ///
    /// # Errors
    /// As for points; `not_ready` if the controller waits for no photo of this camera.
    pub async fn answer_photo(&self, by: &By, granted: Granted, taken: bool) -> Result<(), Problem> {
        let order = Order::Photo { camera: granted.standing.camera(), taken };
        let span = traces::of_command(self.name(), &order.to_string());
        let done = self.try_photo(by, granted, order, taken).instrument(span).await;
        done.map_err(|told| self.refuse_camera(by, granted, "photo", told))
    }

    async fn try_photo(
        &self,
        by: &By,
        granted: Granted,
        order: Order,
        taken: bool,
    ) -> Result<(), (Problem, Told)> {
        let untold = |problem| (problem, Told::No);
        let camera = granted.standing.camera();
        let no_photo = || {
            let message = format!(
                "the controller waits for no photo of camera {camera}: it asked for none over this connection since the \
                 last stop was cleared, or it has the answer"
            );
            untold(Problem::new(Code::NotReady, message))
        };
        let _slot = self.place().map_err(untold)?;
        let fit = self.seat(|seat, now| seat.check_granted(now, granted.standing, &order));
        fit.map_err(|denied| untold(denied.into()))?;
        // Before it is counted: answers that no photo was asked for take no request from other cameras.
        if !self.open_photos().contains(&camera) {
            return Err(no_photo());
        }
        let robot = self.check_camera(granted, &order).map_err(untold)?;
        let now = self.of_photos_now();
        // It is taken out, so that of two answers at once one is sent. One of another connection stays: the
        // seat may not know of that yet.
        let photo = {
            let mut photos = self.cameras.photos();
            let is_of_now = |photo: &Photo| (photo.connection, photo.stops) == now;
            if photos.get(&camera).is_some_and(is_of_now) { photos.remove(&camera) } else { None }
        };
        let photo = photo.ok_or_else(no_photo)?;
        let record = self.record(by, Deed::PhotoAnswer { camera: camera.number(), taken });
        let sent = match self.append(record).await {
            Ok(_) => self.send_of_camera(&robot, granted, order).await,
            Err(error) => Err((CommandOutcome::NotSent, error.into())),
        };
        sent.map(drop).map_err(|(outcome, problem)| {
            if outcome == CommandOutcome::NotSent {
                // The controller may have asked again meanwhile.
                self.cameras.photos().entry(camera).or_insert(photo);
                // The log says already that it was answered, so each of these is written.
                let request = format!("photo camera {camera}");
                self.note(by, Deed::Refused { request, code: problem.code });
            }
            (problem, Told::Yes)
        })
    }

    /// A place among the commands of the robot, and among those of cameras: they wait for the same
    /// connection.
    fn place(&self) -> Result<[SemaphorePermit<'_>; 2], Problem> {
        let overloaded = |message: &str| Problem::new(Code::Overloaded, message);
        let of_cameras = self.cameras.places.try_acquire();
        let of_cameras = of_cameras.map_err(|_| overloaded("too many requests of cameras are under way"))?;
        let of_all = self.commands.try_acquire();
        Ok([of_cameras, of_all.map_err(|_| overloaded("too many commands of this robot are under way"))?])
    }

    /// The handle of the robot, if it may get this from a camera now.
    fn check_camera(&self, granted: Granted, order: &Order) -> Result<Robot, Problem> {
        self.cameras.count(clock::now()).map_err(Problem::too_many)?;
        self.seat(|seat, now| seat.check_granted(now, granted.standing, order))?;
        let robot = self.robot().ok_or_else(|| Problem::new(Code::NotReady, "there is no connection yet"))?;
        if let Order::Points { camera, points } = order {
            let set = CameraSet { cam_id: camera.number().into(), points: points.clone() };
            let checked = robot.check_points(&[set]);
            checked.map_err(|invalid| Problem::new(Code::BadValue, invalid.to_string()))?;
        }
        Ok(robot)
    }

    /// Sends it, if it is still permitted.
    async fn send_of_camera(
        &self,
        robot: &Robot,
        granted: Granted,
        order: Order,
    ) -> Result<Accepted, (CommandOutcome, Problem)> {
        let again = order.clone();
        let permit = self.seat(|seat, now| seat.permit_granted(now, granted.standing, order));
        let permit = permit.and_then(|permit| granted.asked.admit(clock::now(), permit));
        let permit = permit.map_err(|denied| (CommandOutcome::NotSent, denied.into()))?;
        let _sending = self.sending();
        let sent = self.send(robot, permit, None).await;
        sent.map_err(|error| {
            // If it was taken back, the seat knows why.
            let denied = || match &error {
                RequestError::NotSent(_) => {
                    self.seat(|seat, now| seat.check_granted(now, granted.standing, &again)).err()
                }
                _ => None,
            };
            let problem = match denied() {
                Some(denied) => denied.into(),
                // A grant was revoked, or a stop was made and cleared.
                None if matches!(error, RequestError::NotSent(NotSent::Withdrawn)) => {
                    Denied::Overtaken.into()
                }
                None => Problem::of_request(&error),
            };
            (outcome(&error), problem)
        })
    }

    /// Notes a refusal that does not stand in the audit log yet.
    fn refuse_camera(&self, by: &By, granted: Granted, word: &str, told: (Problem, Told)) -> Problem {
        let (problem, told) = told;
        if matches!(told, Told::No) {
            self.note_refused(by, &format!("{word} camera {}", granted.standing.camera()), problem.code);
        }
        problem
    }

    /// Tells that the controller asks for photos, until the handle of the robot is closed.
    pub(super) async fn watch_photos(&self, robot: &Robot) {
        // Connections of this handle are counted anew.
        self.cameras.photos().clear();
        let mut pushed = robot.pushed();
        // The connection that an event is of, once that is known.
        let mut on = Some(robot.connection());
        let mut flood = Flood::default();
        loop {
            match pushed.recv().await {
                Ok(Pushed::Photo { cam_id }) => {
                    let connection = on.unwrap_or_else(|| robot.connection());
                    self.photo_is_asked_for(connection, cam_id, &mut flood);
                }
                Ok(Pushed::ConnectionLost(_)) => {
                    on = None;
                    self.cameras.photos().clear();
                }
                Ok(Pushed::Reconnected(_)) => on = Some(robot.connection()),
                Ok(Pushed::Stray { .. } | Pushed::BadFrame(_) | Pushed::NotJson(_)) => {}
                Err(RecvError::Lagged(missed)) => {
                    // A robot that floods must not fill the log.
                    if !matches!(flood.event(clock::now()), Passage::Skipped) {
                        tracing::warn!(
                            robot = self.name(),
                            missed,
                            "requests for photos may have been missed"
                        );
                    }
                    on = None;
                    self.cameras.photos().clear();
                }
                Err(RecvError::Closed) => return pending().await,
            }
        }
    }

    /// Tells of the photos that the robot asked for over this connection before it said who it is.
    pub(super) fn tell_held_photos(&self, connection: u64) {
        let held: Vec<_> = {
            let mut photos = self.cameras.photos();
            let held =
                photos.iter_mut().filter(|(_, photo)| photo.connection == connection && !photo.is_told);
            held.map(|(camera, photo)| {
                photo.is_told = true;
                *camera
            })
            .collect()
        };
        for camera in held {
            let _ = self.cameras.asked.send(camera);
            self.publish(Happened::PhotoRequested { camera: camera.number().into() });
        }
    }

    fn photo_is_asked_for(&self, connection: u64, cam_id: i64, flood: &mut Flood) {
        let (is_another, stops, is_stopped) = self.seat(|seat, _| {
            (seat.identity_change().is_some(), seat.stops_begun(), seat.stops() != (false, 0))
        });
        if is_another {
            // It is not the robot of this name.
            return;
        }
        let is_told = self.answers(connection) == Answers::This;
        if let Some(camera) = Camera::new(cam_id) {
            let mut photos = self.cameras.photos();
            photos.remove(&camera);
            // While a stop holds, it may be from before the arm was stopped, and is not answered later.
            if !is_stopped {
                photos.insert(camera, Photo { connection, at: clock::now(), stops, is_told });
                if is_told {
                    // There may be no raw client.
                    let _ = self.cameras.asked.send(camera);
                }
            }
        }
        if !is_told {
            // Once it has said who it is, [`Self::tell_held_photos`] does.
            return;
        }
        match flood.event(clock::now()) {
            Passage::Told => self.publish(Happened::PhotoRequested { camera: cam_id }),
            Passage::More => {
                tracing::warn!(robot = self.name(), "it asks for more photos than are told in a second");
            }
            Passage::Skipped => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use r6_api::gateway::Role;
    use r6_client::RobotSettings;
    use r6_sim::VirtualController;

    use super::*;
    use crate::core::name::RobotName;
    use crate::core::role::Grant;
    use crate::fleet::config::RobotConfig;
    use crate::fleet::roads::Roads;
    use crate::fleet::station::{Kept, Shared, Term};
    use crate::store::{Keeper, NewToken, Sqlite};

    #[tokio::test]
    async fn what_was_asked_for_before_its_grant_was_revoked_does_not_leave() {
        let controller = VirtualController::start().await.unwrap();
        let folder = tempfile::tempdir().unwrap();
        let keeper = Keeper::start(Sqlite::open(folder.path()).unwrap()).unwrap();
        let (config, term) = (
            RobotConfig::new(RobotName::new("press").unwrap(), controller.address().to_string()),
            Term::alone(keeper.clone()),
        );
        let shared = Arc::new(Shared::new(keeper.clone(), Roads::Tcp, None, 0));
        let station = Station::new(config, Kept::default(), term, shared);
        let robot =
            Robot::connect(&controller.address().to_string(), RobotSettings::default()).await.unwrap();
        robot.status().await.unwrap();
        station.robot.send_replace(Some(robot.clone()));
        station.seat(|seat, now| seat.observed(now, robot.connection(), false));

        let author = Author::shell(clock::time_of_day());
        let token = NewToken {
            hash: [1; 32],
            grant: Grant { role: Role::Viewer, robots: None },
            name: String::new(),
            expires: None,
        };
        let token = keeper.add_token(token, author.clone()).await.unwrap();
        let (camera, by) = (Camera::new(0).unwrap(), By { actor: "token 1".to_owned(), source: None });
        station.grant_camera(author.clone(), camera, token).await.unwrap();
        let points = vec![Point { x: 1.0, ..Point::default() }];
        let granted = station.granted(&by, camera, Some(token)).await.unwrap();
        assert_eq!(station.add_points(&by, granted, points.clone()).await.unwrap().taken, Some(1));

        let granted = station.granted(&by, camera, Some(token)).await.unwrap();
        assert!(station.revoke_camera(author, camera, token).await.unwrap());
        let problem = station.add_points(&by, granted, points).await.unwrap_err();
        assert_eq!(problem.code, Code::NotReady, "{problem:?}");
        assert_eq!(controller.handle().snapshot().points, [(0, 1)]);
        let problem = station.granted(&by, camera, Some(token)).await.unwrap_err();
        assert_eq!(problem.code, Code::NotAllowed);
    }

    #[tokio::test]
    async fn a_photo_is_told_once_the_robot_has_said_who_it_is() {
        let folder = tempfile::tempdir().unwrap();
        let keeper = Keeper::start(Sqlite::open(folder.path()).unwrap()).unwrap();
        let config = RobotConfig::new(RobotName::new("press").unwrap(), "10.0.0.1");
        let term = Term::alone(keeper.clone());
        let shared = Arc::new(Shared::new(keeper, Roads::Tcp, None, 0));
        let station = Station::new(config, Kept::default(), term, shared);
        let (mut told, mut flood) = (station.photos(), Flood::default());
        station.photo_is_asked_for(4, 2, &mut flood);
        assert!(told.try_recv().is_err(), "it may be another robot");
        station.introduced(Some(3));
        assert!(told.try_recv().is_err(), "that was another connection");
        station.introduced(Some(4));
        assert_eq!(told.try_recv().ok(), Camera::new(2));
        station.introduced(Some(4));
        assert!(told.try_recv().is_err(), "once");
        station.photo_is_asked_for(4, 3, &mut flood);
        assert_eq!(told.try_recv().ok(), Camera::new(3));
    }
}
