//! Embeds the dashboard, if it was built: writes the list of its files for `src/http/page.rs`. A build for
//! development reads the files when they are asked for instead, so it has none of them in it.

use std::fs;
use std::io::{self, Error};
use std::path::{Path, PathBuf};

fn main() -> io::Result<()> {
    let missing = |name: &str| Error::other(format!("cargo sets {name}"));
    let root = std::env::var_os("CARGO_MANIFEST_DIR").ok_or_else(|| missing("CARGO_MANIFEST_DIR"))?;
    let out = std::env::var_os("OUT_DIR").ok_or_else(|| missing("OUT_DIR"))?;
    let built = Path::new(&root).join("page/built");
    let mut files = Vec::new();
    if std::env::var_os("CARGO_CFG_DEBUG_ASSERTIONS").is_some() {
        println!("cargo::rerun-if-changed=build.rs");
    } else {
        // Cargo looks at all files of this folder.
        println!("cargo::rerun-if-changed=page");
        list(&built, &mut files)?;
    }
    let name = |file: &PathBuf| {
        let name = file.strip_prefix(&built).map_err(Error::other)?;
        Ok((name.to_string_lossy().replace('\\', "/"), file.to_string_lossy().into_owned()))
    };
    let mut files = files.iter().map(name).collect::<io::Result<Vec<_>>>()?;
    // In the order of a binary search.
    files.sort();
    let mut text =
        String::from("/// The files of the dashboard: path and bytes. Empty if it was not built.\n");
    text += "static FILES: &[(&str, &[u8])] = &[\n";
    for (name, file) in files {
        text += &format!("    ({name:?}, include_bytes!({file:?})),\n");
    }
    text += "];\n";
    fs::write(Path::new(&out).join("page.rs"), text)
}

/// All files below a folder. A folder that does not exist has none.
fn list(folder: &Path, files: &mut Vec<PathBuf>) -> io::Result<()> {
    let entries = match fs::read_dir(folder) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(()),
        entries => entries?,
    };
    for entry in entries {
        let path = entry?.path();
        if path.is_dir() { list(&path, files)? } else { files.push(path) }
    }
    Ok(())
}
