//! Faults that a person gives the controller while it runs, besides those of its scenario.

use std::sync::Arc;
use std::time::Duration;

use r6_proto::time::Instant;

use super::super::Controller;
use super::Breakage;
use crate::fault::Fault;
use crate::panel::Refused;
use crate::scenario::{Happening, MAX_GIVEN, Turn};

/// A fault that is in force.
#[derive(Clone, Debug, PartialEq)]
pub struct FaultInForce {
    /// Its number, which no other fault of this controller has or gets.
    pub number: usize,
    /// The fault.
    pub fault: Fault,
    /// How likely it strikes each time it can, 0 to 1.
    pub chance: f64,
    /// For how long it is still in force; `None` until a person ends it.
    pub left: Option<Duration>,
}

impl Controller {
    /// Gives the controller a fault, from now on. It strikes with this chance each time it can, and ends
    /// after `lasts`, if that is given. Returns its number.
    ///
    /// # Errors
    /// [`Refused::NoRoom`]: too many faults are in force that were given like this.
    pub fn begin_fault(
        &mut self,
        now: Instant,
        fault: Fault,
        chance: f64,
        lasts: Option<Duration>,
    ) -> Result<usize, Refused> {
        self.advance(now);
        let number = self.breakage_of(now).run.give(now, fault, chance, lasts);
        let number = number.ok_or_else(|| Refused::NoRoom {
            reason: format!("{MAX_GIVEN} faults are in force: end one first"),
        })?;
        self.change_faults(now);
        self.react(now);
        Ok(number)
    }

    /// What can be broken, also of a controller that was switched on without a scenario.
    fn breakage_of(&mut self, now: Instant) -> &mut Breakage {
        let seed = self.settings.seed;
        self.breakage.get_or_insert_with(|| Box::new(Breakage::new(Arc::default(), seed, now)))
    }

    /// The mains fail now, for this long. What survives is as in a scenario.
    pub fn cut_power(&mut self, now: Instant, off: Duration) {
        self.advance(now);
        self.breakage_of(now);
        self.happen(now, Turn::Happens(Happening::PowerCut { off, program: None }));
    }

    /// Ends a fault that is in force, of the scenario too. Another number changes nothing.
    pub fn end_fault(&mut self, now: Instant, number: usize) {
        self.advance(now);
        let Some(breakage) = &mut self.breakage else { return };
        if breakage.in_force.contains(&number) {
            breakage.run.end_fault(now, number);
            self.change_faults(now);
            self.react(now);
        }
    }

    /// The faults in force, in the order of their numbers.
    pub fn faults(&mut self, now: Instant) -> Vec<FaultInForce> {
        self.advance(now);
        let Some(breakage) = &self.breakage else { return Vec::new() };
        let fault = |number: &usize| {
            let (fault, chance) = breakage.run.fault(*number)?;
            let left = breakage.run.left(now, *number);
            Some(FaultInForce { number: *number, fault: fault.clone(), chance, left })
        };
        breakage.in_force.iter().filter_map(fault).collect()
    }
}
