//! The disk that states are saved on: this computer's, or a simulated one.

use std::fmt;
use std::fs::{self, File};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// One operation on a disk.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum DiskStep {
    /// Writes a file, which then has exactly these bytes; creates it if necessary. A power cut may leave any
    /// part of them.
    Write {
        /// The file.
        file: PathBuf,
        /// Its whole content.
        bytes: Vec<u8>,
    },
    /// Makes the content of a file survive a power cut; its name may not survive.
    Sync {
        /// The file.
        file: PathBuf,
    },
    /// Renames a file, and replaces a file with the new name.
    Rename {
        /// The file.
        from: PathBuf,
        /// Its new name.
        to: PathBuf,
    },
    /// Makes the names in a folder survive a power cut.
    SyncFolder {
        /// The folder.
        folder: PathBuf,
    },
}

/// A disk. Without [`crate::SimSettings::disk`] it is this computer's. A test that cuts the power needs a
/// disk that knows what was safe at that time.
pub trait Disk: fmt::Debug + Send + Sync + 'static {
    /// The content of a file, cut off after `most` bytes; `None` if there is no such file.
    ///
    /// # Errors
    /// Why the file cannot be read.
    fn read(&self, file: &Path, most: u64) -> io::Result<Option<Vec<u8>>>;

    /// Carries out one step. It is complete when this returns.
    ///
    /// # Errors
    /// Why the step cannot be carried out.
    fn carry_out(&self, step: &DiskStep) -> io::Result<()>;

    /// How long the next step takes on the clock of the runtime, on a simulated disk. The step is carried out
    /// after that time.
    fn takes(&self, step: &DiskStep) -> Duration;

    /// Whether a step blocks its thread, and [`Self::takes`] does not count.
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

/// Makes a folder's list of names survive a power cut, on systems that can open a folder.
pub(crate) fn sync(folder: &Path) -> io::Result<()> {
    if cfg!(unix) { File::open(folder)?.sync_all() } else { Ok(()) }
}
