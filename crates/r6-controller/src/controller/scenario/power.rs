//! Power cuts: the mains fail and come back.

use std::time::Duration;

use r6_proto::server::ServerSession;
use r6_proto::time::Instant;

use super::super::{Controller, LIMITS, Service};
use crate::event::Event;
use crate::machine::Machine;
use crate::panel::PanelAction;

impl Controller {
    /// Replaces the machine by what a power cut leaves. It hears nothing until the mains are back.
    pub(super) fn power_down(&mut self, now: Instant, off: Duration, program: Option<&str>) {
        self.collect_machine_events();
        let Some(breakage) = &mut self.breakage else { return };
        breakage.run.power_is_back(now + off);
        let mut machine = Machine::restored((*self.settings).clone(), &self.machine.saved(), now);
        machine.stands_as(&self.machine);
        let chosen = program
            .map_or(Ok(()), |program| machine.operate(&PanelAction::SwitchProgram(program.to_owned())));
        self.machine = machine;
        breakage.off = true;
        breakage.held.clear();
        breakage.run.lose_lists();
        breakage.frozen = None;
        // Data on its way is lost.
        for connection in self.connections.values_mut() {
            *connection.session = ServerSession::new(LIMITS);
        }
        if let Err(why) = chosen {
            self.tell(now, Event::ProgramNotChosen { why });
        }
        self.change_faults(now);
    }

    pub(super) fn power_up(&mut self, now: Instant) {
        let Some(breakage) = &mut self.breakage else { return };
        breakage.off = false;
        // The places of half-open connections are free again: nothing else would end these connections.
        self.connections.retain(|_, connection| connection.service != Service::Wedged);
        // The restarted controller does not know these connections, so it answers anything on them with a
        // reset.
        for (id, connection) in &mut self.connections {
            connection.service = Service::Over;
            self.woken.push_back(*id);
        }
        self.tell(now, Event::MainsAreBack);
        self.change_faults(now);
    }

    /// Whether the mains have failed.
    pub(in crate::controller) fn is_off(&self) -> bool {
        self.breakage.as_ref().is_some_and(|breakage| breakage.off)
    }
}

impl Machine {
    /// Takes over what a power cut does not change. The arm stands where its brakes caught it, and its
    /// encoders still know the position. The cell sets the inputs. A pressed emergency stop stays pressed.
    fn stands_as(&mut self, before: &Self) {
        self.axes = before.motion().axes;
        self.homed = before.homed;
        self.io.inputs = before.io.inputs;
        self.io.eu_inputs = before.io.eu_inputs;
        self.starts = before.starts.wrapping_add(1);
        if before.emergency_stop {
            // An emergency stop is never refused.
            let _ = self.operate(&PanelAction::EmergencyStop);
        }
    }
}
