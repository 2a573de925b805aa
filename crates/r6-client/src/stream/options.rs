//! How a motion is streamed: timing, list size, and what happens to the arm if the motion fails.

use std::time::Duration;

use r6_proto::OperationMode;

use crate::done::WaitOptions;

/// How a motion is run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RunOptions {
    /// The pause between the answer to one read of the state and the next read. Default 50 ms, which real
    /// controllers tolerate for hours. There is no minimum: with 0 the state is read as fast as answers come.
    pub interval: Duration,
    /// The maximum number of instructions in one frame, within [`crate::RobotSettings::max_frame_bytes`].
    /// Default 8: on one unit, frames of eight were always answered, and frames of ten to sixteen never
    /// (reported, unit A). It is not known whether their number or their bytes matter.
    pub frame_instructions: usize,
    /// The maximum number of instructions in the controller's list. Default 24: three frames, so that one may
    /// be late by the time of sixteen moves. The capacity of real lists is not known; 17 in one go were
    /// streamed (reported, unit A).
    ///
    /// The arm continues with what is in the list when the connection breaks. A motion that is appended or
    /// repeats is not streamed: it has to fit as a whole.
    pub room: usize,
    /// The same as [`WaitOptions::settle`].
    pub settle: Duration,
    /// How long after a list was accepted the arm may stand elsewhere than at its end, with an empty list.
    /// Default 1 s.
    pub start_within: Duration,
    /// How long the arm may stand without progress, not counting waits and delays of the motion. Default 5 s.
    /// Does not apply to a motion that is appended or repeats, because its progress cannot be seen.
    pub stall_within: Duration,
    /// The same as [`WaitOptions::idle_mode`].
    pub idle_mode: OperationMode,
    /// Whether the client first clears a list that is left from before, if no other condition is unmet.
    /// Default: no, the leftover list is reported as an error.
    pub clear_leftover: bool,
    /// Whether the motion is appended to the controller's list, which may be running. Default: no, it
    /// replaces the list, which has to be empty. A motion that this handle itself is running has to be
    /// released first ([`crate::MotionHandle::release`]).
    ///
    /// It is sent at once and as a whole, and `done` of its [`crate::Progress`] stays 0 until the end.
    /// [`crate::EndProof`] tells what proves the end. Without a proof the motion ends with
    /// [`crate::Cause::NotProved`].
    pub append: bool,
    /// Whether the client stops the arm and clears its list ([`crate::Robot::stop`]) when the motion fails
    /// after something was sent: outcome unknown, alarm, another mode, no progress. Default: yes.
    pub stop_on_failure: bool,
    /// Whether the client stops the arm when the handle is dropped, or the robot's handle is closed
    /// ([`crate::Robot::close`]). Default: no. Then a motion with a dropped handle is streamed to its end,
    /// and a motion with a closed robot ends with what is in its list.
    pub stop_on_drop: bool,
}

impl Default for RunOptions {
    fn default() -> Self {
        let wait = WaitOptions::default();
        Self {
            interval: wait.interval,
            frame_instructions: 8,
            room: 24,
            settle: wait.settle,
            start_within: wait.start_within,
            stall_within: Duration::from_secs(5),
            idle_mode: wait.idle_mode,
            clear_leftover: false,
            append: false,
            stop_on_failure: true,
            stop_on_drop: false,
        }
    }
}

impl RunOptions {
    /// The maximum number of instructions in one frame, limited by the list size.
    pub(crate) fn frame_length(&self) -> usize {
        self.frame_instructions.min(self.room).max(1)
    }
}
