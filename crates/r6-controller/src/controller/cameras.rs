//! Which connection is which camera's: those that the controller itself opened to a camera, and those that spoke as one.
//!
//! The manual calls `camID` the unique number of a camera (5.2) and puts it into each photo request (5.1), but does not say over which
//! connection a request goes. What is chosen here stands in `docs/PROTOCOL.md`, section 13.

use std::collections::{BTreeMap, VecDeque};

use super::ConnectionId;
use crate::event::Event;

/// How many cameras that have spoken are remembered; beyond, the one that was silent for longest is forgotten. A cell has a few,
/// and a peer can name as many as it likes.
const MAX_SPEAKERS: usize = 64;

/// The cameras of one controller.
#[derive(Debug, Default)]
pub(super) struct Cameras {
    /// The cameras that the shell dials, connected or not: a `camID`, or `None` for every one. The shell bounds them.
    dialled: Vec<Option<i64>>,
    /// The connections that were opened to them.
    links: BTreeMap<ConnectionId, Option<i64>>,
    /// Who last spoke as which `camID`, the last one last.
    speakers: VecDeque<(i64, ConnectionId)>,
}

/// Where a photo request goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Route {
    /// To this connection.
    To(ConnectionId),
    /// To all connections that are not another camera's: nobody has said which of them is the camera.
    ToAll,
    /// To nobody: the camera is dialled, and away.
    Away,
}

impl Cameras {
    /// A camera is dialled from now on.
    pub fn expect(&mut self, cam_id: Option<i64>) {
        if !self.dialled.contains(&cam_id) {
            self.dialled.push(cam_id);
        }
    }

    /// A connection was opened to a camera that is dialled.
    pub fn connect(&mut self, id: ConnectionId, cam_id: Option<i64>) {
        self.expect(cam_id);
        self.links.insert(id, cam_id);
    }

    /// A connection has ended.
    pub fn disconnect(&mut self, id: ConnectionId) {
        self.links.remove(&id);
        self.speakers.retain(|(_, speaker)| *speaker != id);
    }

    /// A connection has spoken as a camera. What is odd about it, the first time.
    pub fn spoke(&mut self, id: ConnectionId, cam_id: i64) -> Option<Event> {
        let known = self.speakers.iter().any(|speaker| *speaker == (cam_id, id));
        self.speakers.retain(|(camera, _)| *camera != cam_id);
        if self.speakers.len() >= MAX_SPEAKERS {
            self.speakers.pop_front();
        }
        self.speakers.push_back((cam_id, id));
        match self.links.get(&id) {
            Some(Some(dialled)) if *dialled != cam_id && !known => {
                Some(Event::CameraSpeaksAsAnother { dialled: *dialled, speaks_as: cam_id })
            }
            Some(_) | None => None,
        }
    }

    /// Whether a connection was opened to another camera than this.
    pub fn is_of_another(&self, id: ConnectionId, cam_id: i64) -> bool {
        self.links.get(&id).is_some_and(|dialled| dialled.is_some_and(|dialled| dialled != cam_id))
    }

    /// Where a request for this camera goes: to the connection that was opened to it; else to the one that last spoke as it; else,
    /// unless it is dialled and away, to the one that last spoke as any camera.
    pub fn route(&self, cam_id: i64) -> Route {
        let link = |wanted: Option<i64>| self.links.iter().find(|(_, dialled)| **dialled == wanted);
        if let Some((id, _)) = link(Some(cam_id)) {
            return Route::To(*id);
        }
        let is_dialled = self.dialled.contains(&Some(cam_id));
        let every = link(None).filter(|_| !is_dialled);
        let mut speakers = self.speakers.iter().rev();
        let speaker = speakers.clone().find(|(camera, _)| *camera == cam_id);
        if let Some(id) = every.map(|(id, _)| *id).or(speaker.map(|(_, id)| *id)) {
            return Route::To(id);
        }
        if is_dialled || self.dialled.contains(&None) {
            return Route::Away;
        }
        let other = speakers.find(|(_, id)| !self.is_of_another(*id, cam_id));
        other.map_or(Route::ToAll, |(_, id)| Route::To(*id))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_peer_that_names_every_number_fills_nothing() {
        let mut cameras = Cameras::default();
        for cam_id in 0..10_000 {
            cameras.spoke(ConnectionId(1), cam_id);
        }
        assert_eq!(cameras.speakers.len(), MAX_SPEAKERS);
        assert_eq!(cameras.route(9_999), Route::To(ConnectionId(1)));
        cameras.disconnect(ConnectionId(1));
        assert_eq!((cameras.speakers.len(), cameras.route(9_999)), (0, Route::ToAll));
    }
}
