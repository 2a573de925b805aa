//! A connection while faults of its link are in force, or data that they delayed is on its way.

use std::io;
use std::time::Duration;

use r6_traffic::link::{Delivery, Link};
use tokio::io::AsyncReadExt;
use tracing::trace;

use super::{Conversation, End, Next, write};
use crate::wire::Wire;

impl<W: Wire> Conversation<'_, W> {
    /// Serves the connection over this link; `None` once the link has no effect any more.
    pub(super) async fn run_faulty(&mut self, link: &mut Link) -> io::Result<Option<End>> {
        loop {
            self.give_frames(link).await;
            self.tell_strikes(link);
            if let Some(end) = self.write_due(link).await? {
                return Ok(Some(end));
            }
            if self.give_input(link) {
                continue;
            }
            if self.is_over() {
                return Ok(Some(End::Reset));
            }
            let held_back = self.controller.next_transmit(self.id);
            if self.half_closed && held_back.is_none() && link.is_idle() {
                return Ok(Some(End::Closed));
            }
            if link.is_transparent() {
                return Ok(None);
            }
            self.wait(link, held_back).await?;
        }
    }

    /// Gives the link the frames of the controller while it takes them. The rest piles up in the controller,
    /// which gives up a connection that takes too little.
    async fn give_frames(&mut self, link: &mut Link) {
        while link.takes_frames() {
            match self.next_frame() {
                Next::Frame => {}
                Next::Nothing { .. } => return,
                Next::LinkChanged => {
                    self.change(link);
                    continue;
                }
            }
            self.controller.kept(self.id).await;
            // The link takes frames: checked above.
            let _ = link.send(self.controller.reach(None), &self.frame);
        }
        self.change(link);
    }

    fn tell_strikes(&self, link: &mut Link) {
        while let Some(fault) = link.poll_strike() {
            self.controller.look(|controller, now| controller.struck(now, self.id, fault));
        }
    }

    fn change(&mut self, link: &mut Link) {
        // A fault that struck and ends with this change is still logged.
        self.tell_strikes(link);
        self.controller.look(|controller, now| {
            if controller.link_changes() != self.link_changes {
                self.link_changes = controller.link_changes();
                link.set_faults(now, controller.link_faults());
            }
        });
    }

    /// Writes what is due now; returns how the connection ends, if it does.
    async fn write_due(&mut self, link: &mut Link) -> io::Result<Option<End>> {
        loop {
            let now = self.controller.reach(link.next_due());
            match link.poll_to_client(now) {
                None => return Ok(None),
                Some(Delivery::Close) => return Ok(Some(End::HungUp)),
                Some(Delivery::Reset) => return Ok(Some(End::Reset)),
                Some(Delivery::Bytes(bytes)) => {
                    trace!(connection = self.id.number(), bytes = %String::from_utf8_lossy(&bytes), "sent");
                    write(&mut self.stream, &bytes).await?;
                    // A peer on the same thread, as in a test, can then read each piece separately.
                    tokio::task::yield_now().await;
                }
            }
        }
    }

    /// Gives the controller the bytes that have arrived by now. Returns whether there were any.
    fn give_input(&mut self, link: &mut Link) -> bool {
        let mut any = false;
        while let Some(bytes) = link.poll_to_controller(self.controller.reach(link.next_due())) {
            trace!(connection = self.id.number(), bytes = %String::from_utf8_lossy(&bytes), "received");
            self.controller.handle_input(self.id, &bytes);
            any = true;
        }
        any
    }

    /// Waits for whatever comes first: bytes, a change, or a deadline.
    async fn wait(&mut self, link: &mut Link, held_back: Option<Duration>) -> io::Result<()> {
        let due = link.next_due().map(|due| self.controller.until(due));
        let due = if link.takes_frames() { held_back.into_iter().chain(due).min() } else { due };
        let room = link.room().min(self.input.len());
        let input = self.input.get_mut(..room).unwrap_or_default();
        tokio::select! {
            biased;
            read = self.stream.read(input), if !self.half_closed && room > 0 => {
                let bytes = input.get(..read?).unwrap_or_default();
                self.half_closed = bytes.is_empty();
                // There is room for all of it, because no more was read.
                let _ = link.receive(self.controller.reach(None), bytes);
            }
            () = self.notice.notified() => {}
            () = tokio::time::sleep(due.unwrap_or_default()), if due.is_some() => {}
        }
        Ok(())
    }
}
