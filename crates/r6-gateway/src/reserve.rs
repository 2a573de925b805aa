//! Room on the disk that a gateway holds, for what must not be lost when the disk is full: that a stop holds,
//! and the start of a gateway, without which no stop passes through it.
//!
//! The room is the file `reserve`:
//!
//! ```text
//! held:   it has all its blocks ── a stop that the disk does not take, a start on a full disk ──▶ empty
//! empty:  a stop may not be on the disk ── the next start lets one hold for each robot ──▶ none
//! none:   nothing is lacking ── a stop that the disk does not take ──▶ empty
//! empty, none: ── there is room again ──▶ held
//! ```

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

/// A start of a gateway.
#[derive(Debug)]
pub struct Start {
    folder: PathBuf,
    /// Whether a stop of the gateway before may be lost: the disk was full then, or is now.
    pub may_lack_stops: bool,
    /// Whether this start has the room, and gives it back unless it goes well.
    has_room: bool,
}

impl Start {
    /// Gives the room free for a start, if the disk is full. To be called under the lock of the folder.
    pub fn begin(folder: &Path) -> Self {
        let path = folder.join(FILE);
        // A copy with holes has no room either, and says nothing.
        let was_used = path.symlink_metadata().is_ok_and(|file| file.is_file() && file.len() == 0);
        let is_full = files::free_bytes(folder).is_some_and(|free| free < BYTES);
        let has_room = is_full && use_up(folder, "this start");
        Self { folder: folder.to_owned(), may_lack_stops: was_used || is_full, has_room }
    }

    /// The first start in a folder: it has no stop to lose.
    pub fn first(folder: &Path) -> Self {
        Self { folder: folder.to_owned(), may_lack_stops: false, has_room: false }
    }

    /// The gateway runs: the room is not given back, and no stop is lacking any more.
    pub fn succeeded(mut self) {
        self.has_room = false;
        let path = self.folder.join(FILE);
        if self.may_lack_stops && !is_held(&path) {
            // If it stays, the next start lets stops hold once more.
            let _ = files::remove(&path);
        }
    }
}

impl Drop for Start {
    /// A start that failed for another reason leaves the room to the next one.
    fn drop(&mut self) {
        if self.has_room
            && let Err(error) = make(&self.folder.join(FILE))
        {
            tracing::warn!(folder = %self.folder.display(), %error, "the room for a start was lost");
        }
    }
}

/// Gives the room free, if it is held, and marks it as used in any case. Returns whether there is more room
/// now. `what`: what needs it.
pub fn use_up(folder: &Path, what: &str) -> bool {
    let path = folder.join(FILE);
    let was_held = is_held(&path);
    // Without a file, an empty one says the same. A full disk may take its name.
    let emptied = if was_held { empty(&path) } else { files::make_file(&path) };
    match emptied {
        Ok(()) if was_held => {
            tracing::warn!(
                folder = %folder.display(),
                "the disk is full, or fails: {what} uses the room that the gateway held for that. Stops go on; on a full disk \
                 the history pauses, and commands are refused once this room is used up. Look at the disk"
            );
            true
        }
        Ok(()) => false,
        Err(error) => {
            tracing::debug!(path = %path.display(), %error, "the room could not be marked as used");
            // The blocks may be free all the same.
            was_held
        }
    }
}

/// Gives the blocks of the file free.
fn empty(path: &Path) -> io::Result<()> {
    let file = File::options().write(true).open(path)?;
    file.set_len(0)?;
    file.sync_all()
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
    make(&path)
}

/// Makes the file with all its blocks, in the place of whatever has its name. It is there with all of them,
/// or as before: a kill must not leave an empty one, which would say that a stop is lacking.
fn make(path: &Path) -> io::Result<()> {
    let part = path.with_extension("part");
    // What a kill has left.
    files::remove(&part)?;
    files::make_file(&part)?;
    let made = File::options().write(true).open(&part).and_then(|file| allocate(&file));
    let made = made.and_then(|()| {
        let none = || io::Error::new(io::ErrorKind::Unsupported, "this file system holds no room");
        if is_held(&part) { std::fs::rename(&part, path) } else { Err(none()) }
    });
    made.inspect_err(|_| {
        let _ = files::remove(&part);
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
        assert!(!Start::begin(folder.path()).may_lack_stops && is_held(&path));
        // What a kill leaves while it is made says nothing.
        std::fs::rename(&path, path.with_extension("part")).unwrap();
        assert!(!Start::begin(folder.path()).may_lack_stops);
        hold(folder.path(), 0).unwrap();
        assert!(is_held(&path) && !path.with_extension("part").exists());
        // A copy that makes holes holds no room.
        File::create(&path).unwrap().set_len(BYTES).unwrap();
        assert!(!is_held(&path) && !Start::begin(folder.path()).may_lack_stops);
        hold(folder.path(), 0).unwrap();
        assert!(is_held(&path));
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
    fn a_start_after_the_room_was_used_may_lack_stops_until_it_is_held_again() {
        let folder = tempfile::tempdir().unwrap();
        let may_lack_stops = || Start::begin(folder.path()).may_lack_stops;
        assert!(!may_lack_stops());
        // Also where it was not held.
        assert!(!use_up(folder.path(), "a test"));
        assert!(may_lack_stops());
        hold(folder.path(), 0).unwrap();
        assert!(!may_lack_stops());
        assert!(use_up(folder.path(), "a test"));
        assert!(!use_up(folder.path(), "a test") && may_lack_stops());
        // A start that let stops hold has none to lose any more.
        Start::begin(folder.path()).succeeded();
        assert!(!may_lack_stops());
        // A start that had the room and failed gives it back.
        let folder = folder.path().to_owned();
        drop(Start { folder: folder.clone(), may_lack_stops: true, has_room: true });
        assert!(is_held(&folder.join(FILE)));
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
