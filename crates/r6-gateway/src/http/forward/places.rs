//! Places for what is passed on. What waits for an owner that froze, and what one caller asks for again and
//! again, takes no place from the requests and stops of others.

use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};

use crate::core::owner::Owned;
use crate::core::pass::Bearer;

/// How many requests are passed on to one owner at once. Each has a connection, and a gateway takes 128 of
/// one peer: these, [`STOPS_TO_OWNER`], and some that end.
const TO_OWNER: usize = 48;

/// How many of them one caller has.
const OF_CALLER: usize = 16;

/// How many requests are passed on at once, to all owners.
const IN_ALL: usize = 512;

/// How many stops are on their way to one owner at once.
const STOPS_TO_OWNER: usize = 64;

/// How many stops of one robot wait or are on their way, as many as an owner takes.
const STOPS_OF_ROBOT: usize = 16;

/// How many of them one caller has. A caller who presses again has the first ones under way.
const STOPS_OF_CALLER: usize = 8;

/// How many stops of one caller wait or are on their way, of all robots.
const STOPS_OF_CALLER_IN_ALL: usize = 256;

/// How many stops wait or are on their way, of all robots and callers.
const STOPS_IN_ALL: usize = 1_024;

/// Whose places these are.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Whose {
    All,
    Owner(u64),
    Caller(Bearer, u64),
    AllStops,
    StopsTo(u64),
    StopsOf(Owned),
    StopsBy(Bearer),
    StopsByAndOf(Bearer, Owned),
}

/// All places of this process.
#[derive(Debug)]
pub struct Places(Mutex<BTreeMap<Whose, usize>>);

/// A place, until it is dropped.
#[derive(Debug)]
#[must_use]
pub struct Place<'p> {
    places: &'p Places,
    whose: Vec<Whose>,
}

impl Places {
    /// No place is taken.
    pub const fn new() -> Self {
        Self(Mutex::new(BTreeMap::new()))
    }

    /// A place for a request of this caller to this owner.
    pub fn request(&self, caller: &Bearer, owner: u64) -> Option<Place<'_>> {
        let caller = Whose::Caller(caller.clone(), owner);
        self.take(&[(Whose::All, IN_ALL), (Whose::Owner(owner), TO_OWNER), (caller, OF_CALLER)])
    }

    /// A place for a stop of this caller, until it is answered.
    pub fn stop(&self, caller: &Bearer, robot: &Owned) -> Option<Place<'_>> {
        let of_caller = Whose::StopsByAndOf(caller.clone(), robot.clone());
        self.take(&[
            (Whose::AllStops, STOPS_IN_ALL),
            (Whose::StopsOf(robot.clone()), STOPS_OF_ROBOT),
            (Whose::StopsBy(caller.clone()), STOPS_OF_CALLER_IN_ALL),
            (of_caller, STOPS_OF_CALLER),
        ])
    }

    /// A place for a stop that goes to this owner.
    pub fn stop_to(&self, owner: u64) -> Option<Place<'_>> {
        self.take(&[(Whose::StopsTo(owner), STOPS_TO_OWNER)])
    }

    fn take(&self, wanted: &[(Whose, usize)]) -> Option<Place<'_>> {
        let mut taken = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let is_full = |(whose, most): &(Whose, usize)| taken.get(whose).is_some_and(|count| count >= most);
        if wanted.iter().any(is_full) {
            return None;
        }
        let whose: Vec<_> = wanted.iter().map(|(whose, _)| whose.clone()).collect();
        for whose in &whose {
            *taken.entry(whose.clone()).or_default() += 1;
        }
        Some(Place { places: self, whose })
    }
}

impl Drop for Place<'_> {
    fn drop(&mut self) {
        let mut taken = self.places.0.lock().unwrap_or_else(PoisonError::into_inner);
        for whose in &self.whose {
            if let Some(count) = taken.get_mut(whose) {
                *count -= 1;
                if *count == 0 {
                    taken.remove(whose);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::name::RobotName;

    fn robot(name: &str) -> Owned {
        Owned::Robot(RobotName::new(name).unwrap())
    }

    #[test]
    fn no_owner_and_no_caller_takes_the_places_of_others() {
        let places = Places::new();
        let (one, two) = (Bearer::Token(1), Bearer::Token(2));
        let mut held: Vec<_> = (0..100).filter_map(|_| places.request(&one, 7)).collect();
        assert_eq!(held.len(), OF_CALLER);
        assert!(places.request(&two, 7).is_some() && places.request(&one, 8).is_some());
        held.extend((3..100).flat_map(|token| places.request(&Bearer::Token(token), 7)));
        assert_eq!(held.len(), TO_OWNER);
        assert!(places.request(&two, 7).is_none() && places.request(&two, 8).is_some());

        let (press, saw) = (robot("press"), robot("saw"));
        let mut stops: Vec<_> = (0..40).filter_map(|_| places.stop(&one, &press)).collect();
        assert_eq!(stops.len(), STOPS_OF_CALLER);
        stops.extend((2..40).filter_map(|token| places.stop(&Bearer::Token(token), &press)));
        assert_eq!(stops.len(), STOPS_OF_ROBOT);
        assert!(places.stop(&one, &saw).is_some(), "stops of another robot");
        let sent: Vec<_> = (0..100).filter_map(|_| places.stop_to(7)).collect();
        assert_eq!(sent.len(), STOPS_TO_OWNER);
        assert!(places.stop_to(8).is_some(), "stops to another owner");
        drop((held, stops, sent));
        assert!(places.0.lock().unwrap().is_empty());
    }
}
