//! How a motion is streamed: paces, room, and what becomes of the arm where it fails.

use std::time::Duration;

use r6_proto::OperationMode;

use crate::done::WaitOptions;

/// How a motion is run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RunOptions {
    /// The pause between the answer to one read of the state and the next read. Default 50 ms, which real
    /// controllers bear for hours. There is no minimum: with 0 the state is read as fast as answers come.
    pub interval: Duration,
    /// Instructions in one frame at most, within [`crate::RobotSettings::max_frame_bytes`]. Default 8: eight were always
    /// answered, ten to sixteen never on one unit (reported, unit A), and nobody knows whether their number counts or
    /// their bytes.
    pub frame_instructions: usize,
    /// Instructions in the controller's list at most. Default 24: three frames, so that one can be late by the time of
    /// sixteen moves. How much room real lists have is not known; 17 in one go were streamed (reported, unit A).
    ///
    /// What is in the list runs on when the connection breaks. What is appended, or repeats, is not streamed: it has to fit as a whole.
    pub room: usize,
    /// As [`WaitOptions::settle`].
    pub settle: Duration,
    /// How long after a list was accepted the arm may stand elsewhere than at its end, with an empty list. Default 1 s.
    pub start_within: Duration,
    /// How long the arm may stand without progress, waits and delays of the motion apart. Default 5 s. Not for what is appended or
    /// repeats: nobody can see how far that is.
    pub stall_within: Duration,
    /// As [`WaitOptions::idle_mode`].
    pub idle_mode: OperationMode,
    /// Whether a list that is left from before is cleared first, if nothing else is in the way. Default: no, it is told.
    pub clear_leftover: bool,
    /// Whether the motion goes behind what is in the controller's list, which may be running. Default: no, it replaces the list, which has to
    /// be empty. A motion that this handle itself is running has to be released first ([`crate::MotionHandle::release`]).
    ///
    /// It is sent at once and as a whole, and `done` of its [`crate::Progress`] stays 0 until the end. What proves the end is told by
    /// [`crate::EndProof`]; where nothing does, the motion ends with [`crate::Cause::NotProved`].
    pub append: bool,
    /// Whether the arm is stopped and its list cleared ([`crate::Robot::stop`]) when the motion fails after something has left:
    /// outcome unknown, alarm, another mode, no progress. Default: yes.
    pub stop_on_failure: bool,
    /// Whether the arm is stopped when the handle is dropped, or the robot's handle is closed ([`crate::Robot::close`]). Default: no. A motion
    /// whose handle was dropped is then streamed on to its end; one whose robot was closed ends with what is in its list.
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
    /// Instructions in one frame at most: no more than there is room for.
    pub(crate) fn frame_length(&self) -> usize {
        self.frame_instructions.min(self.room).max(1)
    }
}
