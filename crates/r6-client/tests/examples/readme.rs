//! What the README shows is what is run here.

use std::path::Path;

use crate::cell::Cell;
use crate::ten_lines;

fn read(path: &str) -> String {
    std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(path)).unwrap()
}

#[test]
fn the_readme_shows_the_ten_lines() {
    let example = read("examples/ten_lines.rs");
    let code = example.split_once("\n\n").unwrap().1.split_once("\n\n#[tokio::main").unwrap().0;
    for page in ["../../README.md", "../../docs/QUICKSTART.md"] {
        assert!(read(page).contains(&format!("```rust\n{code}\n```")), "{page} does not show:\n{code}");
    }
}

#[tokio::test(start_paused = true)]
async fn the_ten_lines_move_the_arm() {
    let mut cell = Cell::new().await;
    ten_lines::ten_lines(cell.robot.address()).await.unwrap();
    assert_eq!(cell.error(&[10.0, 0.0, 0.0, 0.0, 30.0, 0.0]), 0.0);
    assert_eq!(cell.lists().len(), 1);
}
