//! Room on the disk that a gateway holds, so that it starts again when the disk is full: without a gateway, no
//! stop passes through it.
//!
//! The room is a file. A start for which the disk has too little room removes it, and the gateway makes it
//! again when there is room.

use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::time::Duration;

use crate::files;
use crate::history::MIN_FREE;

/// The file.
const FILE: &str = "reserve";

/// What a start and the stops after it need: the log of the store goes into its file, some 4 MiB in general,
/// and a stop with its entries takes some ten kilobytes.
const BYTES: u64 = 16 * 1024 * 1024;

/// How often to look whether there is room again.
const LOOK: Duration = Duration::from_secs(60);

/// Gives the room free, if the disk has less for this start. To be called under the lock of the folder.
///
/// # Errors
/// What the system says.
pub fn give_way(folder: &Path) -> io::Result<()> {
    let path = folder.join(FILE);
    if files::free_bytes(folder).is_none_or(|free| free >= BYTES) || !path.exists() {
        return Ok(());
    }
    files::remove(&path)?;
    tracing::warn!(
        folder = %folder.display(),
        "the disk is full: the gateway starts in the room that it held for that. Stops go on; the history pauses, and \
         commands are refused once this room is used up. Make room on the disk"
    );
    Ok(())
}

/// Takes the room again whenever it can.
pub async fn keep(folder: PathBuf) {
    loop {
        let of = folder.clone();
        let held = tokio::task::spawn_blocking(move || hold(&of)).await;
        if let Ok(Err(error)) = held {
            tracing::debug!(folder = %folder.display(), %error, "no room is held for a start on a full disk");
        }
        tokio::time::sleep(LOOK).await;
    }
}

/// Takes the room, if it is not held, and if the disk has so much more that the history goes on.
fn hold(folder: &Path) -> io::Result<()> {
    let path = folder.join(FILE);
    // A kill can have left a file without its room.
    if std::fs::metadata(&path).is_ok_and(|file| file.len() >= BYTES) {
        return Ok(());
    }
    if files::free_bytes(folder).is_none_or(|free| free < MIN_FREE) {
        return Ok(());
    }
    files::make_file(&path)?;
    allocate(&File::options().write(true).open(&path)?)
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
mod tests {
    use super::*;

    #[test]
    #[cfg(target_os = "linux")]
    fn the_room_has_all_its_blocks_and_is_taken_once() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(FILE);
        // A kill right after it was made.
        files::make_file(&path).unwrap();
        hold(folder.path()).unwrap();
        hold(folder.path()).unwrap();
        let file = std::fs::metadata(&path).unwrap();
        let blocks = std::os::unix::fs::MetadataExt::blocks(&file);
        assert_eq!((file.len(), blocks * 512 >= BYTES), (BYTES, true));
        // The disk of this test has room.
        give_way(folder.path()).unwrap();
        assert!(path.exists());
    }
}
