//! Room on the disk that a gateway holds, so that it starts again when the disk is full: without a gateway,
//! no stop passes through it.
//!
//! The room is a file. A start for which the disk has too little room removes it, and the gateway makes it
//! again when there is room.

use std::fs::{File, Metadata};
use std::io;
use std::path::{Path, PathBuf};
use std::time::Duration;

use crate::files;

/// The file.
const FILE: &str = "reserve";

/// What a start and the stops after it need: the log of the store goes into its file, some 4 MiB in general,
/// and a stop with its entries takes some ten kilobytes.
const BYTES: u64 = 16 * 1024 * 1024;

/// How often to look whether there is room again.
const LOOK: Duration = Duration::from_secs(60);

/// Gives the room free, if the disk has less for this start. To be called under the lock of the folder. If
/// that fails, the start goes on: it may have enough.
pub fn give_way(folder: &Path) {
    let path = folder.join(FILE);
    let held = path.metadata().is_ok_and(|file| has_room(&file));
    if !held || files::free_bytes(folder).is_none_or(|free| free >= BYTES) {
        return;
    }
    match files::remove(&path) {
        Ok(()) => tracing::warn!(
            folder = %folder.display(),
            "the disk is full: the gateway starts in the room that it held for that. Stops go on; the history pauses, \
             and commands are refused once this room is used up. Make room on the disk"
        ),
        Err(error) => tracing::warn!(
            path = %path.display(), %error,
            "the disk is full, and the room that was held for this start could not be given free in order"
        ),
    }
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
    // A kill, or a copy of the folder, can have left a file without its room.
    if path.metadata().is_ok_and(|file| has_room(&file)) {
        return Ok(());
    }
    if files::free_bytes(folder).is_none_or(|free| free < min_free.saturating_add(BYTES)) {
        return Ok(());
    }
    files::make_file(&path)?;
    let held = File::options().write(true).open(&path).and_then(|file| allocate(&file));
    held.inspect_err(|_| {
        // An empty file would look like room.
        let _ = files::remove(&path);
    })
}

/// Whether the file has all its blocks.
#[cfg(unix)]
fn has_room(file: &Metadata) -> bool {
    /// The unit of `st_blocks`, whatever the file system has.
    const BLOCK: u64 = 512;
    std::os::unix::fs::MetadataExt::blocks(file).saturating_mul(BLOCK) >= BYTES
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
        let room = || path.metadata().is_ok_and(|file| has_room(&file));
        hold(folder.path(), 0).unwrap();
        assert!(room());
        hold(folder.path(), 0).unwrap();
        // The disk of this test is not full.
        give_way(folder.path());
        assert!(room());
        // What a kill leaves, and what a copy leaves that makes holes.
        for length in [0, BYTES] {
            File::create(&path).unwrap().set_len(length).unwrap();
            assert!(!room());
            hold(folder.path(), 0).unwrap();
            assert!(room(), "{length}");
        }
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
