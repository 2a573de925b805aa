//! Which connection belongs to which camera: the connections that the controller opened to a camera, and
//! those that spoke as one.
//!
//! The manual calls `camID` the unique number of a camera (5.2) and puts it into each photo request (5.1),
//! but does not say over which connection a request goes. `docs/PROTOCOL.md`, section 13, says what we chose.

use std::collections::{BTreeMap, VecDeque};

use super::ConnectionId;
use crate::event::Event;

/// How many `camID`s that have spoken are remembered. Beyond that, the longest silent one is forgotten. A
/// cell has a few cameras, but a peer can send any number of `camID`s.
const MAX_SPEAKERS: usize = 64;

/// The cameras of one controller.
#[derive(Debug, Default)]
pub(super) struct Cameras {
    /// The cameras that the shell dials, connected or not: a `camID`, or `None` for every camera. The shell
    /// bounds their number.
    dialled: Vec<Option<i64>>,
    /// The connections that were opened to these cameras.
    links: BTreeMap<ConnectionId, Option<i64>>,
    /// Which connection last spoke as which `camID`; the most recent is last.
    speakers: VecDeque<(i64, ConnectionId)>,
}

/// Where a photo request goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Route {
    /// To this connection.
    To(ConnectionId),
    /// To all connections that do not belong to another camera: none has said that it is this camera.
    ToAll,
    /// Nowhere: the shell dials the camera, and it is not connected.
    Away,
}

impl Cameras {
    /// Adds a camera that the shell dials from now on.
    pub fn expect(&mut self, cam_id: Option<i64>) {
        if !self.dialled.contains(&cam_id) {
            self.dialled.push(cam_id);
        }
    }

    /// Adds a connection that was opened to a camera.
    pub fn connect(&mut self, id: ConnectionId, cam_id: Option<i64>) {
        self.expect(cam_id);
        self.links.insert(id, cam_id);
    }

    /// Removes a connection that has ended.
    pub fn disconnect(&mut self, id: ConnectionId) {
        self.links.remove(&id);
        self.speakers.retain(|(_, speaker)| *speaker != id);
    }

    /// Notes that a connection has spoken as a camera. Returns a warning the first time it speaks as another
    /// camera than the one dialled.
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

    /// Whether a connection was opened to a camera other than this.
    pub fn is_of_another(&self, id: ConnectionId, cam_id: i64) -> bool {
        self.links.get(&id).is_some_and(|dialled| dialled.is_some_and(|dialled| dialled != cam_id))
    }

    /// Where a request for this camera goes: to the connection that was opened to it; else to the connection
    /// that last spoke as it; else to the connection that last spoke as any camera, unless the shell dials
    /// this camera and it is not connected.
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
