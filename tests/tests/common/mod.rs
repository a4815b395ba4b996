//! The commands, built once beside the test, and folders to run them in.
#![allow(dead_code)]

pub mod browser;

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value;

/// The workspace.
pub const ROOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/..");

/// Builds packages and gives the folder of their commands: cargo gives a test only the binaries of its own package.
pub fn built(packages: &[&str]) -> PathBuf {
    let exe = std::env::current_exe().expect("a test has a path");
    let folder = exe
        .parent()
        .and_then(Path::parent)
        .expect("target/PROFILE/deps/test")
        .to_owned();
    let mut build = Command::new(env!("CARGO"));
    build.args(["build", "--quiet"]).current_dir(ROOT);
    for package in packages {
        build.args(["-p", package]);
    }
    if folder.ends_with("release") {
        build.arg("--release");
    }
    assert!(
        build.status().expect("cargo runs").success(),
        "the commands do not build"
    );
    folder
}

/// Runs a command and gives what it said, where it ended well.
#[track_caller]
pub fn run(command: &mut Command) -> Output {
    let output = command.output().expect("the command starts");
    assert!(
        output.status.success(),
        "{command:?}: {:?}: {}",
        output.status.code(),
        String::from_utf8_lossy(&output.stderr)
    );
    output
}

/// Standard output as JSON.
pub fn json(output: &Output) -> Value {
    serde_json::from_slice(&output.stdout).expect("JSON on standard output")
}

/// A program on PATH.
pub fn on_path(names: &[&str]) -> Option<PathBuf> {
    let path = std::env::var_os("PATH").unwrap_or_default();
    let folders: Vec<PathBuf> = std::env::split_paths(&path).collect();
    names
        .iter()
        .flat_map(|name| folders.iter().map(move |folder| folder.join(name)))
        .find(|file| file.is_file())
}
