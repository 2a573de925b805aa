//! Waits that only a program has, not a list of a PC: for points, photos and registers, and waits with
//! another way out.

use r6_proto::alarm::AlarmCode;
use r6_proto::message::Point;
use r6_proto::time::Instant;
use r6_proto::{OperationMode, RegisterIndex};

use super::{Machine, Place};
use crate::event::{ModeReason, Reason};
use crate::machine::execution::{Activity, Awaited, duration};
use crate::program::{Photo, Step};

/// How many photo requests wait to be sent. Further ones are dropped.
const MAX_PHOTOS: usize = 16;

impl Machine {
    /// Notes that registers were written, and checks whether the program waits for them.
    pub(in crate::machine) fn registers_written(&mut self, first: RegisterIndex, count: usize) {
        let numbers = (first.number()..).take(count).map_while(RegisterIndex::new);
        self.program.written.extend(numbers);
        self.look_again(Awaited::Registers);
    }

    /// Checks whether the program waits for points, after a camera has sent some.
    pub(in crate::machine) fn points_have_come(&mut self) {
        self.look_again(Awaited::Point);
    }

    /// Checks the waiting step again. If it still waits, its deadline stays the same.
    fn look_again(&mut self, awaited: Awaited) {
        let Activity::Awaiting { what, until } = &self.activity else { return };
        if *what != awaited || matches!(what, Awaited::Photo(..)) {
            return;
        }
        self.program.awaiting = Some(*until);
        self.activity = Activity::Idle;
        self.run_list();
        self.program.awaiting = None;
    }

    pub(super) fn position_of_point(&self, camera: i64, model: Option<i64>) -> Option<usize> {
        let wanted = |(from, point): &(i64, Point)| {
            *from == camera && model.is_none_or(|model| point.model_id == model)
        };
        self.cameras.points.iter().position(wanted)
    }

    pub(super) fn take_point(
        &mut self,
        (camera, model): (i64, Option<i64>),
        limit: Option<f64>,
        or_else: Option<usize>,
    ) {
        let found = self.position_of_point(camera, model).and_then(|at| self.cameras.points.remove(at));
        match (found, or_else) {
            (Some((_, point)), _) => {
                self.program.point = Some(self.place_of(&point));
                self.program.awaiting = None;
                self.program.next();
            }
            (None, Some(to)) if limit.is_none() => self.go_on_at(to),
            (None, _) => self.await_until(Awaited::Point, limit),
        }
    }

    pub(super) fn wait_for_registers(&mut self, first: RegisterIndex, count: u16, limit: Option<f64>) {
        let range = first.number()..first.number() + count;
        let written = &mut self.program.written;
        let before = written.len();
        written.retain(|register| !range.contains(&register.number()));
        if written.len() < before {
            self.program.awaiting = None;
            self.program.next();
        } else {
            self.await_until(Awaited::Registers, limit);
        }
    }

    /// Waits for something. If the step waited before, its deadline stays the same.
    fn await_until(&mut self, what: Awaited, limit: Option<f64>) {
        let before = self.program.awaiting.take();
        let until = before.unwrap_or_else(|| limit.map(|limit| self.now + duration(limit)));
        self.activity = Activity::Awaiting { what, until };
    }

    /// Resumes a wait that a pause interrupted.
    pub(in crate::machine) fn await_again(&mut self, what: Awaited, until: Option<Instant>) {
        self.activity = Activity::Awaiting { what, until };
        self.look_again(what);
    }

    /// Asks for a photo, and waits for the answer if it has a limit.
    pub(super) fn ask_for_photo(&mut self, photo: &Photo, tries: u32) {
        if self.cameras.photos.len() < MAX_PHOTOS {
            self.cameras.photos.push_back(photo.camera);
        }
        match photo.limit {
            None => self.program.next(),
            Some(limit) => {
                let until = Some(self.now + duration(limit));
                self.activity = Activity::Awaiting { what: Awaited::Photo(*photo, tries), until };
            }
        }
    }

    /// Handles a camera's answer to a photo request.
    pub(crate) fn photo_answered(&mut self, camera: i64, taken: bool) {
        let Activity::Awaiting { what: Awaited::Photo(photo, tries), .. } = &self.activity else { return };
        let (photo, tries) = (*photo, *tries);
        if photo.camera != camera {
            return;
        }
        self.activity = Activity::Idle;
        if taken {
            self.program.next();
            if self.mode == OperationMode::SingleStep {
                self.leave_running(ModeReason::SingleStep);
            }
        } else {
            self.photo_failed(&photo, tries, Reason::NoPhoto { camera });
        }
        self.run_list();
    }

    fn photo_failed(&mut self, photo: &Photo, tries: u32, why: Reason) {
        if tries > 1 {
            self.ask_for_photo(photo, tries - 1);
        } else {
            self.raise_here(photo.alarm, why);
        }
    }

    /// Ends a wait that ran out.
    pub(in crate::machine) fn awaited_in_vain(&mut self, what: &Awaited) {
        match what {
            Awaited::Photo(photo, tries) => {
                let seconds = photo.limit.unwrap_or(0.0);
                self.photo_failed(photo, *tries, Reason::NoAnswerToPhoto { camera: photo.camera, seconds });
            }
            Awaited::Point => match self.program.step() {
                Some(Step::TakePoint { or_else: Some(to), .. }) => {
                    let to = *to;
                    self.go_on_at(to);
                }
                _ => self.raise_here(AlarmCode::NO_POINTS, Reason::NoPointInTime),
            },
            Awaited::Registers => {
                self.raise_here(AlarmCode::PROGRAM, Reason::RegistersNotWritten);
            }
        }
    }

    /// Ends the program's wait for an input or M point that ran out. Returns true if the wait has another way
    /// out.
    pub(in crate::machine) fn wait_in_vain(&mut self) -> bool {
        let Some(Place { program, step }) = self.program.places.front() else { return false };
        let Some(Step::Wait { or_else: Some(to), .. }) = program.steps().get(*step) else { return false };
        let to = *to;
        self.finish_one();
        self.go_on_at(to);
        true
    }

    /// Skips the wait for the program's trigger in single cycle.
    pub(in crate::machine) fn skip_trigger(&mut self) {
        let Some(Place { program, step }) = self.program.places.front() else { return };
        let skips = matches!(program.steps().get(*step), Some(Step::Wait { skip_in_single_cycle: true, .. }));
        if skips && matches!(self.activity, Activity::Waiting { .. } | Activity::Suspended(..)) {
            self.activity = Activity::Idle;
            self.finish_one();
        }
    }
}
