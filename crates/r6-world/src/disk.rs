//! A disk whose power can be cut. Data that was not yet safe is then lost completely or partly, depending on
//! the seed.

use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use r6_sim::{Disk, DiskStep};
use r6_traffic::random::Random;

/// The longest state file of one controller, in bytes. A full one has some 20 KiB.
pub const MOST_BYTES: usize = 64 << 10;

/// The maximum number of files: the state, and the new one beside it. Damaged files must not exist.
pub const MOST_FILES: usize = 2;

/// A disk. Clones share the same disk. It outlives the controllers that write to it.
#[derive(Clone, Debug)]
pub struct SimDisk(Arc<Mutex<Platters>>);

#[derive(Debug)]
struct Platters {
    random: Random,
    files: Vec<Bytes>,
    /// The names as the running system sees them (`names`), and as they are on the disk (`safe`).
    names: BTreeMap<PathBuf, usize>,
    safe: BTreeMap<PathBuf, usize>,
    /// Changes of names that are not on the disk yet, in their order.
    pending: Vec<Renamed>,
    full: bool,
    /// Number of writes that found no room since the last call of `take_refused`.
    refused: u64,
}

#[derive(Debug, Default)]
struct Bytes {
    now: Vec<u8>,
    safe: Vec<u8>,
}

#[derive(Clone, Debug)]
struct Renamed {
    from: Option<PathBuf>,
    to: PathBuf,
    file: usize,
}

impl SimDisk {
    /// Creates an empty disk.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        let (files, names, safe, pending) = Default::default();
        let random = Random::new(seed);
        Self(Arc::new(Mutex::new(Platters { random, files, names, safe, pending, full: false, refused: 0 })))
    }

    fn platters(&self) -> MutexGuard<'_, Platters> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Sets whether the disk is full and takes no more bytes.
    pub fn set_full(&self, full: bool) {
        self.platters().full = full;
    }

    /// Returns how many writes found no room since the last call.
    #[must_use]
    pub fn take_refused(&self) -> u64 {
        std::mem::take(&mut self.platters().refused)
    }

    /// Whether the file exists.
    #[must_use]
    pub fn has(&self, file: &Path) -> bool {
        self.platters().names.contains_key(file)
    }

    /// The number of files, and the length of the longest in bytes.
    #[must_use]
    pub fn extent(&self) -> (usize, usize) {
        let platters = self.platters();
        let longest = platters.names.values().filter_map(|file| platters.files.get(*file));
        (platters.names.len(), longest.map(|file| file.now.len()).max().unwrap_or(0))
    }

    /// The content of a file if the power failed now and everything that is not safe were lost.
    #[must_use]
    pub fn surely(&self, file: &Path) -> Option<Vec<u8>> {
        let platters = self.platters();
        let found = platters.safe.get(file).and_then(|file| platters.files.get(*file));
        found.map(|file| file.safe.clone())
    }

    /// Cuts the power. Any part of the data that is not safe may survive.
    pub fn cut_power(&self) {
        let mut platters = self.platters();
        let Platters { random, files, names, safe, pending, .. } = &mut *platters;
        // Changes of names reach the disk in their order, as with a journal.
        let kept = random.below(pending.len() + 1);
        for change in pending.drain(..).take(kept) {
            change.apply(safe);
        }
        names.clone_from(safe);
        for file in files {
            if file.now != file.safe {
                match random.below(3) {
                    0 => {}
                    1 => file.safe.clone_from(&file.now),
                    _ => {
                        let some = random.below(file.now.len() + 1);
                        file.safe = file.now.get(..some).unwrap_or_default().to_vec();
                    }
                }
                file.now.clone_from(&file.safe);
            }
        }
    }
}

impl Renamed {
    fn apply(&self, names: &mut BTreeMap<PathBuf, usize>) {
        if let Some(from) = &self.from {
            names.remove(from);
        }
        names.insert(self.to.clone(), self.file);
    }
}

impl Platters {
    fn file(&mut self, path: &Path) -> io::Result<usize> {
        self.names.get(path).copied().ok_or_else(|| io::ErrorKind::NotFound.into())
    }

    fn rename(&mut self, change: Renamed) {
        change.apply(&mut self.names);
        self.pending.push(change);
    }
}

impl Disk for SimDisk {
    fn read(&self, file: &Path, most: u64) -> io::Result<Option<Vec<u8>>> {
        let platters = self.platters();
        let most = usize::try_from(most).unwrap_or(usize::MAX);
        let found = platters.names.get(file).and_then(|file| platters.files.get(*file));
        Ok(found.map(|file| file.now.iter().take(most).copied().collect()))
    }

    fn carry_out(&self, step: &DiskStep) -> io::Result<()> {
        let mut platters = self.platters();
        match step {
            DiskStep::Write { .. } if platters.full => {
                platters.refused += 1;
                return Err(io::ErrorKind::StorageFull.into());
            }
            DiskStep::Write { file, bytes } => {
                let number = match platters.file(file) {
                    Ok(number) => number,
                    Err(_) => {
                        platters.files.push(Bytes::default());
                        let number = platters.files.len() - 1;
                        platters.rename(Renamed { from: None, to: file.clone(), file: number });
                        number
                    }
                };
                if let Some(file) = platters.files.get_mut(number) {
                    file.now.clone_from(bytes);
                }
            }
            DiskStep::Sync { file } => {
                let number = platters.file(file)?;
                if let Some(file) = platters.files.get_mut(number) {
                    file.safe.clone_from(&file.now);
                }
            }
            DiskStep::Rename { from, to } => {
                let file = platters.file(from)?;
                platters.rename(Renamed { from: Some(from.clone()), to: to.clone(), file });
            }
            DiskStep::SyncFolder { .. } => {
                let Platters { names, safe, pending, .. } = &mut *platters;
                safe.clone_from(names);
                pending.clear();
            }
        }
        Ok(())
    }

    fn takes(&self, step: &DiskStep) -> Duration {
        let most = match step {
            DiskStep::Write { .. } | DiskStep::Rename { .. } => Duration::from_millis(2),
            DiskStep::Sync { .. } | DiskStep::SyncFolder { .. } => Duration::from_millis(12),
        };
        self.platters().random.up_to(most)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn replace(disk: &SimDisk, text: &str, steps: usize) {
        let (file, beside) = (PathBuf::from("s/state"), PathBuf::from("s/new"));
        let all = [
            DiskStep::Write { file: beside.clone(), bytes: text.as_bytes().to_vec() },
            DiskStep::Sync { file: beside.clone() },
            DiskStep::Rename { from: beside, to: file },
            DiskStep::SyncFolder { folder: "s".into() },
        ];
        all.iter().take(steps).for_each(|step| disk.carry_out(step).unwrap());
    }

    #[test]
    fn what_was_synced_survives_and_what_was_not_may_be_old_new_or_torn() {
        let read = |disk: &SimDisk| disk.read(Path::new("s/state"), 100).unwrap();
        for steps in 0..=4 {
            let mut seen = std::collections::BTreeSet::new();
            for seed in 0..40 {
                let disk = SimDisk::new(seed);
                replace(&disk, "old", 4);
                replace(&disk, "newer", steps);
                let sure = disk.surely(Path::new("s/state")).unwrap();
                disk.cut_power();
                seen.insert(read(&disk).map(|bytes| String::from_utf8(bytes).unwrap()));
                assert_eq!(sure, if steps < 4 { b"old".as_slice() } else { b"newer" });
            }
            let all: Vec<_> = seen.iter().flatten().map(String::as_str).collect();
            let wanted: &[&str] = match steps {
                0..=2 => &["old"],
                3 => &["newer", "old"],
                _ => &["newer"],
            };
            assert_eq!(all, wanted, "after {steps} steps");
        }
    }

    #[test]
    fn without_a_sync_a_renamed_file_may_be_torn() {
        let torn = (0..40).any(|seed| {
            let disk = SimDisk::new(seed);
            disk.carry_out(&DiskStep::Write { file: "s/new".into(), bytes: b"newer".to_vec() }).unwrap();
            disk.carry_out(&DiskStep::Rename { from: "s/new".into(), to: "s/state".into() }).unwrap();
            disk.carry_out(&DiskStep::SyncFolder { folder: "s".into() }).unwrap();
            disk.cut_power();
            disk.read(Path::new("s/state"), 100).unwrap().is_some_and(|bytes| bytes.len() < 5)
        });
        assert!(torn);
    }
}
