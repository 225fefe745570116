//! Runs the program in a folder of its own.

#![allow(dead_code, reason = "each test file uses its part")]

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::Output;

use assert_cmd::Command;
use tempfile::TempDir;

/// A scene that renders in an instant, with a petal of cells, a light to sample and a sky.
pub(crate) const SCENE: &str = r#"
[film]
width = 16
height = 12

[camera]
position_mm = [0, -60, 10]
target_mm = [0, 0, 0]
fov_deg = 30

[render]
spp = 2

[petal]
samples = 2

[materials.petal]
type = "petal"

[shapes.ball]
type = "sphere"
radius_mm = 10
subdivisions = 2
material = "petal"

[lights.sky]
type = "constant"
radiance = 0.2

[lights.key]
type = "area"
position_mm = [60, -60, 60]
target_mm = [0, 0, 0]
width_mm = 30
height_mm = 30
radiance = 8
"#;

/// A folder with `scene.toml` in it.
pub(crate) fn folder() -> TempDir {
    let dir = tempfile::tempdir().expect("a temporary folder");
    write(&dir, "scene.toml", SCENE);
    dir
}

pub(crate) fn write(dir: &TempDir, name: &str, content: impl AsRef<[u8]>) {
    fs::write(dir.path().join(name), content).expect("the folder can be written");
}

pub(crate) fn command(dir: &TempDir, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_rosarium"));
    command.current_dir(dir.path()).args(arguments).env_remove("NO_COLOR");
    command
}

/// Names and sizes of all files.
pub(crate) fn files(dir: &Path) -> BTreeMap<String, u64> {
    fs::read_dir(dir)
        .expect("the folder can be read")
        .map(|entry| {
            let entry = entry.expect("an entry");
            (entry.file_name().to_string_lossy().into_owned(), entry.metadata().expect("its size").len())
        })
        .collect()
}

pub(crate) fn read(dir: &TempDir, name: &str) -> Vec<u8> {
    fs::read(dir.path().join(name))
        .unwrap_or_else(|e| panic!("{name}: {e}; there are {:?}", files(dir.path())))
}

/// Runs to a good end; returns what was printed.
pub(crate) fn succeeds(dir: &TempDir, arguments: &[&str]) -> Output {
    let output = command(dir, arguments).output().expect("it runs");
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{arguments:?}: {:?}\n{stderr}", output.status);
    output
}

/// Ends with exit code 2 and one message that has all the words, and leaves every file as it was.
pub(crate) fn fails(dir: &TempDir, arguments: &[&str], words: &[&str]) -> String {
    let before = files(dir.path());
    let output = command(dir, arguments).output().expect("it runs");
    let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{arguments:?}: {stderr}");
    assert!(output.stdout.is_empty(), "{arguments:?} printed {:?}", String::from_utf8_lossy(&output.stdout));
    for word in words {
        assert!(stderr.contains(word), "{arguments:?}: no `{word}` in\n{stderr}");
    }
    let messages = stderr.lines().filter(|l| l.to_lowercase().starts_with("error")).count();
    assert_eq!(messages, 1, "{arguments:?}: {messages} messages in\n{stderr}");
    assert!(!stderr.contains("panicked"), "{stderr}");
    assert_eq!(files(dir.path()), before, "{arguments:?} left files");
    stderr
}
