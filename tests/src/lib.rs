//! End-to-end tests live in `tests/tests`: they run the commands on real files, as a person would. Here is what they share.

use serde_json::Value;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::Mutex;

/// The workspace.
pub const ROOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/..");

/// Path of a command, built once beside this test: cargo gives a test only the binaries of its own package.
///
/// # Panics
/// When it does not build.
pub fn bin(name: &str) -> PathBuf {
    static BUILT: Mutex<BTreeSet<String>> = Mutex::new(BTreeSet::new());
    let exe = std::env::current_exe().expect("a test has a path");
    let folder = exe
        .parent()
        .and_then(Path::parent)
        .expect("target/PROFILE/deps/test");
    let mut built = BUILT
        .lock()
        .unwrap_or_else(std::sync::PoisonError::into_inner);
    if !built.contains(name) {
        // Those that share their dependencies are built together, so that these are built with one set of features.
        let together = ["sim", "analyze", "study"];
        let packages = if together.contains(&name) {
            &together[..]
        } else {
            &[name]
        };
        let mut build = Command::new(env!("CARGO"));
        build.args(["build", "--quiet"]).current_dir(ROOT);
        for package in packages {
            build.args(["-p", package]);
        }
        if folder.ends_with("release") {
            build.arg("--release");
        }
        let status = build.status().expect("cargo runs");
        assert!(status.success(), "{packages:?} do not build");
        built.extend(packages.iter().map(|p| (*p).to_owned()));
    }
    folder.join(name)
}

/// Runs a command in a folder.
///
/// # Panics
/// When it does not start.
pub fn run_in(folder: &Path, name: &str, args: &[&str]) -> Output {
    let mut command = Command::new(bin(name));
    command.args(args).current_dir(folder);
    command.output().expect("the command starts")
}

/// What a command said, where it ended well.
///
/// # Panics
/// Where it did not, with what it said.
#[track_caller]
pub fn good(output: Output) -> Output {
    assert!(
        output.status.success(),
        "{:?}: {}",
        output.status.code(),
        String::from_utf8_lossy(&output.stderr)
    );
    output
}

/// Names of the files in a folder, sorted.
///
/// # Panics
/// When it cannot be read.
pub fn files(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).expect("the folder is there");
    let name = |e: std::io::Result<std::fs::DirEntry>| {
        let name = e.expect("an entry").file_name();
        name.to_string_lossy().into_owned()
    };
    let mut names: Vec<String> = entries.map(name).collect();
    names.sort();
    names
}

/// Standard output as JSON.
///
/// # Panics
/// When it is none.
pub fn json(output: &Output) -> Value {
    serde_json::from_slice(&output.stdout).expect("JSON on standard output")
}

/// The first of these programs that is on PATH.
pub fn on_path(names: &[&str]) -> Option<PathBuf> {
    let path = std::env::var_os("PATH").unwrap_or_default();
    let folders: Vec<PathBuf> = std::env::split_paths(&path).collect();
    let candidates = |name| folders.iter().map(move |folder| folder.join(name));
    names
        .iter()
        .flat_map(candidates)
        .find(|file| file.is_file())
}

/// A Python that can import these modules: `PYTHON`, a virtual environment in the workspace or beside it, or the one on PATH.
pub fn python_with(modules: &[&str]) -> Option<PathBuf> {
    let named = std::env::var_os("PYTHON").map(PathBuf::from);
    let beside = [".venv", "venv", "../.venv", "../venv"]
        .map(|folder| Path::new(ROOT).join(folder).join("bin/python"));
    let imports = format!("import {}", modules.join(", "));
    let can_import = |python: &PathBuf| {
        let mut try_it = Command::new(python);
        try_it
            .args(["-c", &imports])
            .output()
            .is_ok_and(|o| o.status.success())
    };
    named
        .into_iter()
        .chain(beside)
        .chain(on_path(&["python3", "python"]))
        .find(can_import)
}
