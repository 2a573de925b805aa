//! Settings of the controller that stay after the request that made them: tool, workbench, a watched input.

use std::sync::{Mutex, MutexGuard, PoisonError};

use r6_proto::message::Action;
use r6_proto::message::instruction::Manner;

use crate::error::RequestError;
use crate::job::Work;

/// The settings sent so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct SentSettings {
    /// How often a tool or a workbench was set, or may have been.
    pub frames: u64,
    /// Whether an input may be watched that stops the motion (action 52). It counts until it is switched off,
    /// because it is not known whether the watch ends with its list.
    pub watching: bool,
}

/// The settings sent by all handles of a connection.
#[derive(Debug, Default)]
pub(crate) struct SharedSentSettings(Mutex<SentSettings>);

impl SharedSentSettings {
    /// The settings sent so far.
    pub fn so_far(&self) -> SentSettings {
        *self.lock()
    }

    /// A request is about to be sent. Its settings count, unless it turns out that nothing was sent.
    pub fn leaving(&self, work: &Work) -> Leaving<'_> {
        Leaving { tell: self, tells: Tells::of(work) }
    }

    fn lock(&self) -> MutexGuard<'_, SentSettings> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A request between its checks and its answer. If dropped without an answer, it counts as sent.
#[derive(Debug)]
pub(crate) struct Leaving<'t> {
    tell: &'t SharedSentSettings,
    tells: Tells,
}

impl Leaving<'_> {
    /// Takes in the outcome.
    pub fn answered<T>(mut self, answer: &Result<T, RequestError>) {
        // Controllers have run lists that they refused.
        if matches!(answer, Err(error) if error.nothing_left()) {
            self.tells = Tells::default();
        }
    }
}

impl Drop for Leaving<'_> {
    fn drop(&mut self) {
        let Tells { frame, watching } = self.tells;
        if frame || watching.is_some() {
            let mut told = self.tell.lock();
            told.frames += u64::from(frame);
            told.watching = watching.unwrap_or(told.watching);
        }
    }
}

/// The settings in one request.
#[derive(Clone, Copy, Debug, Default)]
struct Tells {
    frame: bool,
    watching: Option<bool>,
}

impl Tells {
    fn of(work: &Work) -> Self {
        match work {
            Work::Command(command) => Self { frame: command.name().info().changes_frame, watching: None },
            Work::AddRcc { instructions, .. } => {
                instructions.iter().fold(Self::default(), |tells, step| tells.and(&step.action))
            }
            Work::Query(_) | Work::RawQuery(_) | Work::AddPoints(_) | Work::PhotoAnswer(_) => Self::default(),
        }
    }

    fn and(mut self, action: &Action) -> Self {
        // It is not known whether the frames of a move stay in use after it.
        let in_frame = |manner: &Manner| manner.tool.is_some() || manner.coord.is_some();
        match action {
            Action::AxisMove(step) | Action::LinearMove(step) => self.frame |= in_frame(&step.manner),
            Action::CurveMove(curve) => self.frame |= in_frame(&curve.manner),
            Action::Workbench(_) | Action::Unknown(_) => self.frame = true,
            // Once switched on, it may have stopped the list before it is switched off.
            Action::StopOnSignal(stop) if stop.in_use => self.watching = Some(true),
            Action::StopOnSignal(_) => self.watching = self.watching.or(Some(false)),
            Action::PathSpeed(_) | Action::Wait(_) | Action::Output(_) | Action::BoardOutput(_) => {}
        }
        self
    }
}

#[cfg(test)]
mod tests {
    use r6_proto::Command;
    use r6_proto::message::Instruction;
    use r6_proto::message::instruction::{Coordinates, CurveMove, Move, StopOnSignal, Workbench};

    use super::*;
    use crate::error::NotSent;

    fn list(actions: &[Action]) -> Work {
        let step = |action: &Action| Instruction { oneshot: true, action: *action };
        Work::AddRcc { replace: true, instructions: actions.iter().map(step).collect() }
    }

    fn watch(in_use: bool) -> Action {
        Action::StopOnSignal(StopOnSignal { in_use, input: 0, on: true })
    }

    #[test]
    fn what_left_or_may_have_left_counts() {
        let tell = SharedSentSettings::default();
        let bench = list(&[Action::Workbench(Workbench { id: 1 })]);
        tell.leaving(&bench).answered::<()>(&Err(NotSent::Disconnected.into()));
        assert_eq!(tell.so_far().frames, 0);
        tell.leaving(&bench).answered(&Ok(()));
        // Its caller is gone.
        drop(tell.leaving(&bench));
        tell.leaving(&Work::Command(Command::SwitchTool { tool: 1 })).answered(&Ok(()));
        let move_in_frame =
            Move { manner: Manner { coord: Some(0), ..Manner::default() }, ..Move::default() };
        tell.leaving(&list(&[Action::AxisMove(move_in_frame)])).answered(&Ok(()));
        assert_eq!(tell.so_far().frames, 4);
        let curve_with_tool = CurveMove {
            middle: Coordinates::default(),
            end: Coordinates::default(),
            manner: Manner { tool: Some(1), ..Manner::default() },
        };
        let after_bench = [Action::Workbench(Workbench { id: 1 }), Action::AxisMove(Move::default())];
        for actions in [&[Action::CurveMove(curve_with_tool)][..], &after_bench] {
            let told = SharedSentSettings::default();
            told.leaving(&list(actions)).answered(&Ok(()));
            assert_eq!(told.so_far().frames, 1, "{actions:?}");
        }
        tell.leaving(&list(&[Action::AxisMove(Move::default())])).answered(&Ok(()));
        tell.leaving(&Work::Command(Command::StartButton)).answered(&Ok(()));
        assert_eq!(tell.so_far(), SentSettings { frames: 4, watching: false });
    }

    #[test]
    fn a_watch_counts_until_a_later_list_switches_it_off() {
        let tell = SharedSentSettings::default();
        for (actions, watching) in [
            (&[watch(true)][..], true),
            (&[Action::AxisMove(Move::default())], true),
            (&[watch(false)], false),
            (&[watch(true), watch(false)], true),
            (&[watch(false), watch(true)], true),
        ] {
            tell.leaving(&list(actions)).answered(&Ok(()));
            assert_eq!(tell.so_far().watching, watching, "{actions:?}");
        }
    }
}
