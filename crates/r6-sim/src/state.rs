//! The folder of states that survive a power cut: one file per controller, replaced as a whole.
//!
//! A file is written under another name, synced to the disk, and renamed; then the folder is synced. So there
//! is either the old file or the new one, never a part of one, whether the process is killed or the computer
//! loses its power.

use std::fmt;
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use r6_controller::{SavedError, SavedState};

use crate::disk::{Disk, DiskStep, SystemDisk, sync};

/// The longest file that is read. A full state has some 20 KiB.
const MAX_FILE_BYTES: u64 = 16 << 20;

/// How many damaged files of one controller are kept; a further one replaces the last.
const MAX_DAMAGED: u32 = 100;

/// Why a folder of states cannot be used.
#[derive(Debug)]
pub enum StateError {
    /// Another process, or another simulation of this process, uses it.
    Taken {
        /// The folder.
        folder: PathBuf,
    },
    /// A newer release wrote a file, which is left unchanged.
    Newer {
        /// The file.
        file: PathBuf,
        /// The version it gives.
        error: SavedError,
    },
    /// The system refuses an operation.
    Io {
        /// The folder or file.
        path: PathBuf,
        /// What was tried: `opened`, `read`, `written`.
        tried: &'static str,
        /// Why it failed.
        error: io::Error,
    },
}

impl fmt::Display for StateError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Taken { folder } => {
                write!(f, "{} is in use by another r6: give each its own folder", folder.display())
            }
            Self::Newer { file, error } => write!(f, "{}: {error}", file.display()),
            Self::Io { path, tried, error } => {
                write!(f, "{} cannot be {tried}: {error}", path.display())
            }
        }
    }
}

impl std::error::Error for StateError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::Newer { error, .. } => Some(error),
            Self::Io { error, .. } => Some(error),
            Self::Taken { .. } => None,
        }
    }
}

/// A folder of states that only this process uses, until this is dropped or the process ends.
#[derive(Debug)]
pub(crate) struct StateFolder {
    path: PathBuf,
    disk: Arc<dyn Disk>,
    /// The lock while it is open, until the last file of the folder is closed. `None` on a simulated disk.
    lock: Option<Arc<File>>,
}

/// What was found for a controller.
#[derive(Debug)]
pub(crate) enum Found {
    /// Nothing: it is switched on for the first time.
    Nothing,
    /// The state that the power cut left.
    Saved(Box<SavedState>),
    /// A damaged file, which was renamed.
    Damaged {
        /// Which file, what is wrong with it, and its new name.
        why: String,
    },
}

impl StateFolder {
    /// A folder on this disk, or on this computer's.
    pub fn on(disk: Option<&Arc<dyn Disk>>, path: &Path) -> Result<Self, StateError> {
        match disk {
            Some(disk) => Ok(Self { path: path.to_owned(), disk: Arc::clone(disk), lock: None }),
            None => Self::open(path),
        }
    }

    /// Opens a folder, creates it if necessary, and locks it.
    fn open(path: &Path) -> Result<Self, StateError> {
        let failed = |path: &Path| {
            let path = path.to_owned();
            move |error| StateError::Io { path, tried: "opened", error }
        };
        make(path).map_err(failed(path))?;
        let file = path.join("lock");
        let lock =
            OpenOptions::new().create(true).truncate(false).write(true).open(&file).map_err(failed(&file))?;
        match lock.try_lock() {
            Ok(()) => {
                Ok(Self { path: path.to_owned(), disk: Arc::new(SystemDisk), lock: Some(Arc::new(lock)) })
            }
            Err(TryLockError::WouldBlock) => Err(StateError::Taken { folder: path.to_owned() }),
            Err(TryLockError::Error(error)) => Err(failed(&file)(error)),
        }
    }

    /// The file of a controller, by its number from 1.
    pub fn file(&self, number: u64) -> StateFile {
        StateFile {
            path: self.path.join(format!("controller-{number}.json")),
            written: Arc::default(),
            disk: Arc::clone(&self.disk),
            _lock: self.lock.clone(),
        }
    }
}

/// The file of one controller. Clones are the same file.
#[derive(Clone, Debug)]
pub(crate) struct StateFile {
    path: PathBuf,
    /// The number of the change that was written last. The lock allows one write at a time, and an older
    /// state never replaces a newer one.
    written: Arc<Mutex<u64>>,
    disk: Arc<dyn Disk>,
    _lock: Option<Arc<File>>,
}

impl StateFile {
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Reads the file. A damaged file is renamed.
    pub fn read(&self) -> Result<Found, StateError> {
        let failed = |tried| move |error| StateError::Io { path: self.path.clone(), tried, error };
        let read = self.disk.read(&self.path, MAX_FILE_BYTES + 1).map_err(failed("read"))?;
        let Some(bytes) = read else { return Ok(Found::Nothing) };
        let problem = match read_state(&bytes) {
            Ok(state) => return Ok(Found::Saved(Box::new(state))),
            Err(Problem::Newer(error)) => return Err(StateError::Newer { file: self.path.clone(), error }),
            Err(Problem::Damaged(problem)) => problem,
        };
        let aside = self.free_name();
        let rename = DiskStep::Rename { from: self.path.clone(), to: aside.clone() };
        self.disk.carry_out(&rename).map_err(failed("renamed"))?;
        let why = format!(
            "{}: {problem}; the file is kept as {}, and the controller begins anew without what it held: stop it and put the file right, or \
             clear the alarm",
            self.path.display(),
            aside.display()
        );
        Ok(Found::Damaged { why })
    }

    /// A free name for a damaged file.
    fn free_name(&self) -> PathBuf {
        let name = |number: u32| self.path.with_extension(format!("damaged-{number}.json"));
        let is_free = |path: &PathBuf| matches!(self.disk.read(path, 0), Ok(None));
        (1..MAX_DAMAGED).map(name).find(is_free).unwrap_or_else(|| name(MAX_DAMAGED))
    }

    /// Replaces the file as a whole by the state after this change, unless the file is newer. When this
    /// returns, it survives a power cut.
    pub fn write(&self, number: u64, state: &SavedState) -> Result<(), StateError> {
        let mut written = self.written.lock().unwrap_or_else(PoisonError::into_inner);
        if number > *written {
            self.replace(state)?;
            *written = number;
        }
        Ok(())
    }

    /// The same without blocking: on a separate thread, or, on a simulated disk, in its simulated time.
    /// `None` if the runtime ends meanwhile.
    pub async fn write_beside(&self, number: u64, state: SavedState) -> Option<Result<(), StateError>> {
        if self.disk.blocks() {
            let file = self.clone();
            return tokio::task::spawn_blocking(move || file.write(number, &state)).await.ok();
        }
        for step in self.steps(&state) {
            tokio::time::sleep(self.disk.takes(&step)).await;
            if let Err(error) = self.disk.carry_out(&step) {
                return Some(Err(self.not_written(error)));
            }
        }
        *self.written.lock().unwrap_or_else(PoisonError::into_inner) = number;
        Some(Ok(()))
    }

    fn replace(&self, state: &SavedState) -> Result<(), StateError> {
        let mut steps = self.steps(state).into_iter();
        steps.try_for_each(|step| self.disk.carry_out(&step)).map_err(|error| self.not_written(error))
    }

    fn not_written(&self, error: io::Error) -> StateError {
        StateError::Io { path: self.path.clone(), tried: "written", error }
    }

    /// The steps that replace the file. There is never a part of a file under its name, and after the last
    /// step the new file survives a power cut.
    fn steps(&self, state: &SavedState) -> Vec<DiskStep> {
        let beside = self.path.with_extension("json.new");
        let bytes = state.to_json().into_bytes();
        let mut steps = vec![
            DiskStep::Write { file: beside.clone(), bytes },
            DiskStep::Sync { file: beside.clone() },
            DiskStep::Rename { from: beside, to: self.path.clone() },
        ];
        steps.extend(self.path.parent().map(|folder| DiskStep::SyncFolder { folder: folder.to_owned() }));
        steps
    }
}

/// Creates a folder that survives a power cut, with its parents.
fn make(folder: &Path) -> io::Result<()> {
    let missing: Vec<_> = folder.ancestors().take_while(|path| !path.is_dir()).collect();
    fs::create_dir_all(folder)?;
    missing.into_iter().filter_map(Path::parent).try_for_each(|parent| {
        // The parent of a bare name is the current folder.
        sync(if parent.as_os_str().is_empty() { Path::new(".") } else { parent })
    })
}

enum Problem {
    Newer(SavedError),
    Damaged(String),
}

fn read_state(bytes: &[u8]) -> Result<SavedState, Problem> {
    if u64::try_from(bytes.len()).is_ok_and(|length| length > MAX_FILE_BYTES) {
        return Err(Problem::Damaged(format!("longer than {MAX_FILE_BYTES} bytes")));
    }
    let text =
        std::str::from_utf8(bytes).map_err(|error| Problem::Damaged(format!("it is no text: {error}")))?;
    SavedState::from_json(text).map_err(|error| match error {
        SavedError::Newer { .. } => Problem::Newer(error),
        SavedError::Damaged { .. } => Problem::Damaged(error.to_string()),
    })
}
