//! Files that a user names: read as text, up to a length.

use std::io::Read;
use std::path::Path;

/// The text of a file of at most so many bytes; `what` it is stands in the complaint.
pub fn read(path: &Path, what: &str, most: usize) -> Result<String, String> {
    let unread = |error: std::io::Error| format!("the file cannot be read: {error}");
    // One byte more than is possible tells that it is too long.
    let limit = u64::try_from(most).unwrap_or(u64::MAX).saturating_add(1);
    let mut text = String::new();
    std::fs::File::open(path).map_err(unread)?.take(limit).read_to_string(&mut text).map_err(unread)?;
    if text.len() > most {
        return Err(format!("the file is too long: {what} has {most} bytes at most"));
    }
    Ok(text)
}
