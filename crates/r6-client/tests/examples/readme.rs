//! The code in the README is the code that runs here.

use std::path::Path;

use crate::ten_lines;

fn read(path: &str) -> String {
    std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(path)).unwrap()
}

#[test]
fn the_readme_shows_the_ten_lines() {
    let example = read("examples/ten_lines.rs");
    let code = example.split_once("\n\n").unwrap().1.split_once("\n\nfn main").unwrap().0;
    for page in ["../../README.md", "../../docs/QUICKSTART.md"] {
        assert!(read(page).contains(&format!("```rust\n{code}\n```")), "{page} does not show:\n{code}");
    }
}

#[test]
fn the_ten_lines_move_the_arm() {
    let builder = r6_sim::VirtualController::builder().clock(r6_sim::Clock::AsFastAsPossible);
    let controller = builder.start_blocking().unwrap();
    ten_lines::ten_lines(&controller.address().to_string()).unwrap();
    assert_eq!(controller.handle().snapshot().axes[..6], [10.0, 0.0, 0.0, 0.0, 30.0, 0.0]);
}
