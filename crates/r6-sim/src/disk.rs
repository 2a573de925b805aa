//! What states are kept on: the disks of this computer, or one that somebody simulates.

use std::fmt;
use std::fs::{self, File};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// One thing that is done to a disk.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum DiskStep {
    /// A file has these bytes from now on, and is there if it was not. A power cut may leave any part of them.
    Write {
        /// The file.
        file: PathBuf,
        /// All that it has.
        bytes: Vec<u8>,
    },
    /// What a file has survives a power cut from now on; its name may not.
    Sync {
        /// The file.
        file: PathBuf,
    },
    /// A file has another name from now on, in place of whatever had it.
    Rename {
        /// The file.
        from: PathBuf,
        /// Its new name.
        to: PathBuf,
    },
    /// The names in a folder survive a power cut from now on.
    SyncFolder {
        /// The folder.
        folder: PathBuf,
    },
}

/// A disk. The one of this computer is meant unless [`crate::SimSettings::disk`] says otherwise: a test that cuts the power needs one
/// that tells what was safe by then.
pub trait Disk: fmt::Debug + Send + Sync + 'static {
    /// What a file has, cut off after so many bytes; `None` if there is no such file.
    ///
    /// # Errors
    /// Why it cannot be read.
    fn read(&self, file: &Path, most: u64) -> io::Result<Option<Vec<u8>>>;

    /// Does one thing; it is done when this returns.
    ///
    /// # Errors
    /// Why it cannot be done.
    fn carry_out(&self, step: &DiskStep) -> io::Result<()>;

    /// How long the next step takes on the clock of the runtime, where somebody simulates it: it is carried out once that time is over.
    fn takes(&self, step: &DiskStep) -> Duration;

    /// Whether it takes a thread as long as it takes, and no time of its own.
    fn blocks(&self) -> bool {
        false
    }
}

/// The disks of this computer.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SystemDisk;

impl Disk for SystemDisk {
    fn read(&self, file: &Path, most: u64) -> io::Result<Option<Vec<u8>>> {
        let file = match File::open(file) {
            Ok(file) => file,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(error),
        };
        let mut bytes = Vec::new();
        file.take(most).read_to_end(&mut bytes)?;
        Ok(Some(bytes))
    }

    fn carry_out(&self, step: &DiskStep) -> io::Result<()> {
        match step {
            DiskStep::Write { file, bytes } => File::create(file)?.write_all(bytes),
            DiskStep::Sync { file } => File::options().write(true).open(file)?.sync_all(),
            DiskStep::Rename { from, to } => fs::rename(from, to),
            DiskStep::SyncFolder { folder } => sync(folder),
        }
    }

    fn takes(&self, _: &DiskStep) -> Duration {
        Duration::ZERO
    }

    fn blocks(&self) -> bool {
        true
    }
}

/// Brings a folder's list of names to the disk, where the system lets one open a folder.
pub(crate) fn sync(folder: &Path) -> io::Result<()> {
    if cfg!(unix) { File::open(folder)?.sync_all() } else { Ok(()) }
}
