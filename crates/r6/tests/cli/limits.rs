//! Endless files and files that are too long: r6 reads nothing beyond its limit.

use std::os::unix::fs::symlink;

use crate::support::shell;

/// The memory of a run, KiB: far less than an endless file, and enough for idle threads.
const MEMORY_KIB: u32 = 1024 * 1024;

/// Runs r6 with little memory.
fn with_little_memory(line: &str, args: &[&str]) -> crate::support::Outcome {
    shell(&format!("ulimit -v {MEMORY_KIB}; {line}"), args)
}

#[test]
fn a_file_without_an_end_is_read_up_to_its_limit() {
    let folder = tempfile::tempdir().unwrap();
    let endless = |name: &str| {
        let path = folder.path().join(name);
        symlink("/dev/zero", &path).unwrap();
        path.to_str().unwrap().to_owned()
    };
    let (toml, json) = (endless("endless.toml"), endless("endless.json"));
    let model = "the file is too long: a robot model has 262144 bytes at most";
    for (args, wanted) in [
        (&["run", &toml][..], "the file is too long: a program has 16777216 bytes at most"),
        (&["run", &json], "the file is too long: a program has 16777216 bytes at most"),
        (&["plot", &toml], "the file is too long: a program has 16777216 bytes at most"),
        (&["move", "axes", "1", "--guard", &toml], "a file of limits has 65536 bytes at most"),
        (&["sim", "--model", &toml], model),
        (&["sim", "--profile", &toml], "a profile has 262144 bytes at most"),
        (&["sim", "--program", &toml], "a program has 262144 bytes at most"),
        (&["sim", "--scenario", &json], "a scenario has 1048576 bytes at most"),
        (&["plot", "examples/programs/square.toml", "--model", &toml], model),
        (&["panel", "load", &toml], "a program has 262144 bytes at most"),
        (&["inspect", "/dev/zero"], "has more than 268435456 bytes"),
        // The name has no extension, so r6 does not read the file at all.
        (&["run", "/dev/zero"], "a program ends in .json or .toml"),
    ] {
        let outcome = with_little_memory(r#"exec "$R6" "$@""#, args);
        assert_eq!(outcome.code, 2, "{args:?}: {outcome:?}");
        assert!(outcome.err.contains(wanted), "{args:?}: {}", outcome.err);
    }
    for (args, wanted) in [
        (&["run", "-"], "stdin is too long: a program has 16777216 bytes at most"),
        (&["inspect", "-"], "has more than 268435456 bytes"),
    ] {
        let outcome = with_little_memory(r#"exec "$R6" "$@" < /dev/zero"#, args);
        assert_eq!(outcome.code, 2, "{args:?}: {outcome:?}");
        assert!(outcome.err.contains(wanted), "{args:?}: {}", outcome.err);
    }
}
