//! Programs that an operator loads at the machine, and how they come back after a power cut.

use std::collections::BTreeMap;

use super::Machine;
use crate::event::{Detail, Event};
use crate::panel::Refused;
use crate::program::{Library, LibraryError, MAX_LOADED_BYTES, Program};

impl Machine {
    /// Takes a program, and replaces one with the same name. It refuses to replace a program that runs, or
    /// that the running one may call. If the program is in use but does not run, it begins at its first step,
    /// as after `switchMold`.
    pub(super) fn load_program(&mut self, name: &str, text: &str) -> Result<(), Refused> {
        let bad = |reason: String| Refused::BadProgram { reason };
        let program =
            Program::read(name, text).map_err(|mistakes| bad(format!("program `{name}`: {mistakes}")))?;
        let in_use = self.programs.library.reaches(&self.programs.mold, name);
        if in_use && self.mode.may_run() {
            return Err(Refused::ProgramRuns { name: name.to_owned() });
        }
        if in_use && self.is_moving() {
            return Err(Refused::Moving);
        }
        self.check_room(name, text)?;
        let steps = program.steps().len();
        let mut library = self.programs.library.clone();
        library.insert(program.clone()).map_err(|error| match error {
            LibraryError::Full => Refused::NoRoom { reason: format!("{error}: replace one of them") },
            LibraryError::Program { .. } => bad(error.to_string()),
        })?;
        if let Some(missing) = library.missing_call(&program) {
            return Err(bad(format!("program `{name}`: {missing}; load that one first")));
        }
        self.programs.library = library;
        self.programs.loaded.insert(name.to_owned(), text.to_owned());
        self.note(Event::ProgramLoaded { name: Detail::of(name), steps });
        if in_use {
            let mold = self.programs.mold.clone();
            self.switch_mold(&mold).map_err(|reason| Refused::Program { reason: reason.to_string() })?;
        }
        Ok(())
    }

    fn check_room(&self, name: &str, text: &str) -> Result<(), Refused> {
        let others = self.programs.loaded.iter().filter(|(other, _)| *other != name);
        let bytes = others.map(|(_, text)| text.len()).sum::<usize>() + text.len();
        if bytes <= MAX_LOADED_BYTES {
            return Ok(());
        }
        let reason = format!(
            "all loaded programs together would have {bytes} bytes; {MAX_LOADED_BYTES} are possible: replace a longer one"
        );
        Err(Refused::NoRoom { reason })
    }

    /// Takes the programs that were loaded before a power cut. If the controller was given one with the same
    /// name at the start, that one is used; the loaded one is kept for a start without it.
    pub(crate) fn restore_programs(&mut self, loaded: &BTreeMap<String, String>) {
        (*self.programs.loaded).clone_from(loaded);
        for (name, text) in loaded {
            let given = self.programs.library.named(name).filter(|given| !Library::is_shipped(given));
            if given.is_some_and(|given| given.text() != text) {
                self.note(Event::ProgramGivenAtStart { name: Detail::of(name) });
            } else if given.is_none()
                && let Err(error) = self.programs.library.load(name, text)
            {
                self.note(Event::ProgramGone { name: Detail::of(name), why: Detail::of(error) });
            }
        }
    }
}
