//! When a target was sent.

use tokio::time::Instant;

use crate::TargetSender;
use crate::units::AxisPosition;

impl TargetSender {
    /// Sends a new target. Only the newest one counts.
    pub fn send(&self, target: AxisPosition) {
        let sent = Instant::now();
        self.send_aged(target, move || sent.elapsed());
    }
}
