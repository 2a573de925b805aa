//! Room on the disk that a gateway holds, for what must not be lost when the disk is full: that a stop holds,
//! and the start of a gateway, without which no stop passes through it.
//!
//! The room is a file. It is removed for a stop that the disk does not take, and for a start for which the
//! disk has too little room. The gateway makes it again when there is room.

use std::fs::{File, Metadata};
use std::io;
use std::path::{Path, PathBuf};
use std::time::Duration;

use crate::files;

/// The file.
const FILE: &str = "reserve";

/// What a start and the stops after it need: the log of the store goes into its file, some 4 MiB in general,
/// and a stop with its entries takes some ten kilobytes. With less, the disk counts as full.
const BYTES: u64 = 16 * 1024 * 1024;

/// How often to look whether there is room again.
const LOOK: Duration = Duration::from_secs(60);

/// A start of a gateway, and whether the disk had room for it.
#[derive(Debug)]
pub struct Start {
    folder: PathBuf,
    /// Whether the disk was full. A stop of the gateway before may be lost then.
    pub was_full: bool,
    /// Whether this start has the room, and gives it back unless it goes well.
    has_room: bool,
}

impl Start {
    /// Gives the room free for a start, if the disk is full. To be called under the lock of the folder.
    pub fn begin(folder: &Path) -> Self {
        let was_full = is_full(folder);
        let has_room = was_full && give_way(folder, "this start");
        Self { folder: folder.to_owned(), was_full, has_room }
    }

    /// The first start in a folder: it has no stop to lose.
    pub fn first(folder: &Path) -> Self {
        Self { folder: folder.to_owned(), was_full: false, has_room: false }
    }

    /// The gateway runs: the room is not given back.
    pub fn succeeded(mut self) {
        self.has_room = false;
    }
}

impl Drop for Start {
    /// A start that failed for another reason leaves the room to the next one.
    fn drop(&mut self) {
        if self.has_room
            && let Err(error) = hold(&self.folder, 0)
        {
            tracing::warn!(folder = %self.folder.display(), %error, "the room for a start was lost");
        }
    }
}

/// Whether the disk is full.
fn is_full(folder: &Path) -> bool {
    files::free_bytes(folder).is_some_and(|free| free < BYTES)
}

/// Gives the room free, if the disk is full and the room is held. Returns whether there is more room now.
/// `what`: what needs it.
pub fn give_way(folder: &Path, what: &str) -> bool {
    let path = folder.join(FILE);
    if !is_full(folder) || !is_held(&path) {
        return false;
    }
    match files::remove(&path) {
        Ok(()) => {
            tracing::warn!(
                folder = %folder.display(),
                "the disk is full: {what} uses the room that the gateway held for that. Stops go on; the history pauses, \
                 and commands are refused once this room is used up. Make room on the disk"
            );
            true
        }
        Err(error) => {
            tracing::warn!(
                path = %path.display(), %error,
                "the disk is full, and the room that was held could not be given free in order"
            );
            false
        }
    }
}

/// Whether there is the file with all its blocks, and under no other name, by which they would stay.
fn is_held(path: &Path) -> bool {
    path.symlink_metadata().is_ok_and(|file| file.is_file() && has_room(&file))
}

/// Takes the room again whenever the disk has so much, and `min_free` besides: from less than this on, the
/// history pauses.
pub async fn keep(folder: PathBuf, min_free: u64) {
    let mut is_told = false;
    loop {
        let of = folder.clone();
        let held = tokio::task::spawn_blocking(move || hold(&of, min_free)).await;
        // Some file systems hold no room for any file.
        if let Ok(Err(error)) = held
            && !std::mem::replace(&mut is_told, true)
        {
            tracing::warn!(folder = %folder.display(), %error, "no room is held for a start on a full disk");
        }
        tokio::time::sleep(LOOK).await;
    }
}

/// Takes the room, if it is not held, and if the disk has enough.
fn hold(folder: &Path, min_free: u64) -> io::Result<()> {
    let path = folder.join(FILE);
    if is_held(&path) || files::free_bytes(folder).is_none_or(|free| free < min_free.saturating_add(BYTES)) {
        return Ok(());
    }
    // A kill, or a copy of the folder, can have left a file without its room, or a link.
    files::remove(&path)?;
    let held = File::options().write(true).create_new(true).open(&path).and_then(|file| allocate(&file));
    held.inspect_err(|_| {
        // An empty file would look like room.
        let _ = files::remove(&path);
    })
}

/// Whether the file has all its blocks, and one name.
#[cfg(unix)]
fn has_room(file: &Metadata) -> bool {
    use std::os::unix::fs::MetadataExt;

    /// The unit of `st_blocks`, whatever the file system has.
    const BLOCK: u64 = 512;
    file.blocks().saturating_mul(BLOCK) >= BYTES && file.nlink() == 1
}

/// This system does not tell how much is free, so no room is taken.
#[cfg(not(unix))]
fn has_room(_: &Metadata) -> bool {
    false
}

/// Makes the file as long as it has to be, with all its blocks.
#[cfg(target_os = "linux")]
fn allocate(file: &File) -> io::Result<()> {
    Ok(rustix::fs::fallocate(file, rustix::fs::FallocateFlags::empty(), 0, BYTES)?)
}

/// This system does not tell how much is free, so no room is taken.
#[cfg(not(target_os = "linux"))]
fn allocate(_: &File) -> io::Result<()> {
    Ok(())
}

#[cfg(test)]
#[cfg(target_os = "linux")]
mod tests {
    use super::*;

    #[test]
    fn the_room_has_all_its_blocks_and_is_taken_once() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(FILE);
        hold(folder.path(), 0).unwrap();
        assert!(is_held(&path));
        hold(folder.path(), 0).unwrap();
        // The disk of this test is not full.
        assert!(!give_way(folder.path(), "a test"));
        assert!(is_held(&path));
        // What a kill leaves, and what a copy leaves that makes holes.
        for length in [0, BYTES] {
            File::create(&path).unwrap().set_len(length).unwrap();
            assert!(!is_held(&path));
            hold(folder.path(), 0).unwrap();
            assert!(is_held(&path), "{length}");
        }
    }

    #[test]
    fn the_room_has_no_other_name_and_no_link_leads_elsewhere() {
        let folder = tempfile::tempdir().unwrap();
        let (path, other) = (folder.path().join(FILE), folder.path().join("other"));
        hold(folder.path(), 0).unwrap();
        std::fs::hard_link(&path, &other).unwrap();
        assert!(!is_held(&path), "to remove it would give nothing free");
        hold(folder.path(), 0).unwrap();
        assert!(is_held(&path));
        std::fs::write(&other, b"precious").unwrap();
        std::fs::remove_file(&path).unwrap();
        std::os::unix::fs::symlink(&other, &path).unwrap();
        hold(folder.path(), 0).unwrap();
        assert!(is_held(&path));
        assert_eq!(std::fs::read(&other).unwrap(), b"precious");
    }

    #[test]
    fn no_room_is_taken_that_the_history_needs() {
        let folder = tempfile::tempdir().unwrap();
        let free = files::free_bytes(folder.path()).unwrap();
        // Other programs write on this disk, too.
        let about = BYTES * 64;
        hold(folder.path(), free.saturating_add(about)).unwrap();
        assert!(!folder.path().join(FILE).exists());
        hold(folder.path(), free.saturating_sub(about)).unwrap();
        assert!(folder.path().join(FILE).exists());
    }
}
