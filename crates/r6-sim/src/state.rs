//! The folder that keeps what survives a power cut: one file for each controller, replaced as a whole.
//!
//! A file is written beside its place, brought to the disk, and renamed; then the folder is brought to the disk. So there is the
//! old file or the new one and never a part of one, whether the process is killed or the computer loses its power.

use std::fmt;
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use r6_controller::{SavedError, SavedState};

/// The longest file that is read. A full state has some 20 KiB.
const MAX_FILE_BYTES: u64 = 16 << 20;

/// How many damaged files of one controller are kept aside; a further one replaces the last.
const MAX_DAMAGED: u32 = 100;

/// Why a folder of states cannot be used.
#[derive(Debug)]
pub enum StateError {
    /// Another process, or another simulation of this one, uses it.
    Taken {
        /// The folder.
        folder: PathBuf,
    },
    /// A newer program wrote a file: it is left as it is.
    Newer {
        /// The file.
        file: PathBuf,
        /// What it says of itself.
        error: SavedError,
    },
    /// The system refuses something.
    Io {
        /// The folder or file.
        path: PathBuf,
        /// What was tried: `opened`, `read`, `written`.
        tried: &'static str,
        /// Why not.
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

impl std::error::Error for StateError {}

/// A folder of states that is ours alone, until this is dropped or the process ends.
#[derive(Debug)]
pub(crate) struct StateFolder {
    path: PathBuf,
    /// Locked as long as it is open: until the last file of the folder is done with.
    lock: Arc<File>,
}

/// What was found of a controller.
#[derive(Debug)]
pub(crate) enum Found {
    /// Nothing: it is switched on for the first time.
    Nothing,
    /// What the power cut left.
    Saved(Box<SavedState>),
    /// A damaged file, which was kept aside.
    Damaged {
        /// Which file, what is wrong in it, and where it is now.
        why: String,
    },
}

impl StateFolder {
    /// Opens a folder, which is made if it is not there, and locks it.
    pub fn open(path: &Path) -> Result<Self, StateError> {
        let failed = |path: &Path| {
            let path = path.to_owned();
            move |error| StateError::Io { path, tried: "opened", error }
        };
        make(path).map_err(failed(path))?;
        let file = path.join("lock");
        let lock =
            OpenOptions::new().create(true).truncate(false).write(true).open(&file).map_err(failed(&file))?;
        match lock.try_lock() {
            Ok(()) => Ok(Self { path: path.to_owned(), lock: Arc::new(lock) }),
            Err(TryLockError::WouldBlock) => Err(StateError::Taken { folder: path.to_owned() }),
            Err(TryLockError::Error(error)) => Err(failed(&file)(error)),
        }
    }

    /// The file of a controller, by its number from 1.
    pub fn file(&self, number: u64) -> StateFile {
        StateFile {
            path: self.path.join(format!("controller-{number}.json")),
            written: Arc::default(),
            _lock: Arc::clone(&self.lock),
        }
    }
}

/// The file of one controller. Clones are the same file.
#[derive(Clone, Debug)]
pub(crate) struct StateFile {
    path: PathBuf,
    /// The number of the change that was last written: one write at a time, and never an older state over a newer one.
    written: Arc<Mutex<u64>>,
    _lock: Arc<File>,
}

impl StateFile {
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Reads it. A damaged one is put aside under another name.
    pub fn read(&self) -> Result<Found, StateError> {
        let failed = |tried| move |error| StateError::Io { path: self.path.clone(), tried, error };
        let file = match File::open(&self.path) {
            Ok(file) => file,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Found::Nothing),
            Err(error) => return Err(failed("opened")(error)),
        };
        let mut bytes = Vec::new();
        file.take(MAX_FILE_BYTES + 1).read_to_end(&mut bytes).map_err(failed("read"))?;
        let problem = match read_state(&bytes) {
            Ok(state) => return Ok(Found::Saved(Box::new(state))),
            Err(Problem::Newer(error)) => return Err(StateError::Newer { file: self.path.clone(), error }),
            Err(Problem::Damaged(problem)) => problem,
        };
        let aside = self.free_name();
        fs::rename(&self.path, &aside).map_err(failed("renamed"))?;
        let why = format!(
            "{}: {problem}; the file is kept as {}, and the controller begins anew",
            self.path.display(),
            aside.display()
        );
        Ok(Found::Damaged { why })
    }

    /// A name for a damaged file.
    fn free_name(&self) -> PathBuf {
        let name = |number: u32| self.path.with_extension(format!("damaged-{number}.json"));
        (1..MAX_DAMAGED).map(name).find(|path| !path.exists()).unwrap_or_else(|| name(MAX_DAMAGED))
    }

    /// Replaces it as a whole by the state after the change of this number, unless it is newer; when this returns, it
    /// survives a power cut.
    pub fn write(&self, number: u64, state: &SavedState) -> Result<(), StateError> {
        let mut written = self.written.lock().unwrap_or_else(PoisonError::into_inner);
        if number > *written {
            self.replace(state)?;
            *written = number;
        }
        Ok(())
    }

    fn replace(&self, state: &SavedState) -> Result<(), StateError> {
        let beside = self.path.with_extension("json.new");
        let failed = |error| StateError::Io { path: self.path.clone(), tried: "written", error };
        let mut file = File::create(&beside).map_err(failed)?;
        file.write_all(state.to_json().as_bytes()).map_err(failed)?;
        file.sync_all().map_err(failed)?;
        drop(file);
        fs::rename(&beside, &self.path).map_err(failed)?;
        self.path.parent().map_or(Ok(()), sync).map_err(failed)
    }
}

/// Makes a folder that survives a power cut, and what it is in.
fn make(folder: &Path) -> io::Result<()> {
    let missing: Vec<_> = folder.ancestors().take_while(|path| !path.is_dir()).collect();
    fs::create_dir_all(folder)?;
    missing.into_iter().filter_map(Path::parent).try_for_each(|parent| {
        // The parent of a bare name is the folder that we are in.
        sync(if parent.as_os_str().is_empty() { Path::new(".") } else { parent })
    })
}

/// Brings a folder's list of names to the disk, where the system lets one open a folder.
fn sync(folder: &Path) -> io::Result<()> {
    if cfg!(unix) { File::open(folder)?.sync_all() } else { Ok(()) }
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
