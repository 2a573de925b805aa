//! The limits of the files: whole parts are removed, the oldest first. Averages are removed when they are too
//! old, or take too much of the room.

use std::sync::atomic::Ordering;

use super::Journal;
use crate::core::history::sample::Micros;
use crate::store::StoreError;
use crate::store::history::HistoryStore;

/// A day begins a new part when its last one has this share of the bytes. So there is always an older part to
/// remove.
const PART_SHARE: u64 = 8;

/// All averages take this share of the bytes at most, so that values always have the rest.
const AVERAGE_SHARE: u64 = 4;

/// So often while it writes this share of the bytes, the size of the files is looked at.
const LOOK_SHARE: u64 = 64;

impl<S: HistoryStore> Journal<S> {
    /// Removes what is too old or too much, and lets a large day begin a new part.
    pub(super) fn keep_limits(&mut self, time: Micros) -> Result<(), StoreError> {
        let most = self.settings.max_bytes;
        // An insertion changes more pages than it has bytes.
        if !self.has_no_room && self.written.saturating_mul(4) < most / LOOK_SHARE {
            return Ok(());
        }
        self.look_at_limits(time)
    }

    /// The same, whatever was written.
    pub fn look_at_limits(&mut self, time: Micros) -> Result<(), StoreError> {
        self.written = 0;
        let most = self.settings.max_bytes;
        let today = time.day();
        let mut parts = self.store.parts()?;
        let newest = parts.iter().rfind(|(part, _)| part.day == today).copied();
        if let Some((part, size)) = newest
            && (size >= most / PART_SHARE || self.store.is_behind(part))
            && self.is_recovered
        {
            self.seal_for_part(today)?;
            self.store.begin_part(part.day)?;
            parts = self.store.parts()?;
        }
        let averages = self.keep_limits_of_averages(today, most / AVERAGE_SHARE)?;
        self.look_for_days(today);
        let oldest_kept = today.saturating_sub(i64::from(self.settings.keep_days).max(1) - 1);
        let mut size: u64 = averages + parts.iter().map(|(_, size)| size).sum::<u64>();
        // An eighth is left for what is written before the next look.
        let bound = most - most / PART_SHARE;
        // Days that are not yet come of a wrong clock: they go first.
        parts.sort_by_key(|(part, _)| (part.day <= today + 1, *part));
        let newest = parts.iter().map(|(part, _)| *part).rfind(|part| part.day == today);
        let mut left = parts.into_iter().peekable();
        while let Some((part, bytes)) = left.peek().copied() {
            let is_too_old = part.day < oldest_kept && !self.waits_for_averages(part, today);
            // The newest part of today has what is being written.
            if !self.store.may_remove() || (!is_too_old && size <= bound) || Some(part) == newest {
                break;
            }
            self.note_removal(part, today);
            tracing::info!(?part, bytes, "the oldest file of the history is removed");
            self.store.remove(part)?;
            self.counts.removed.fetch_add(1, Ordering::Relaxed);
            size = size.saturating_sub(bytes);
            left.next();
        }
        self.counts.bytes.store(size, Ordering::Relaxed);
        self.counts.oldest_day.store(left.next().map_or(0, |(part, _)| part.day), Ordering::Relaxed);
        let free = self.store.free_bytes().filter(|free| *free < self.settings.min_free);
        self.has_no_room = free.is_some();
        if let Some(free) = free {
            let told = format!(
                "{free} bytes are free on its disk: history pauses below {}, so that the audit log has room",
                self.settings.min_free
            );
            return Err(StoreError::Unavailable(told));
        }
        Ok(())
    }
}
