//! The Rerun viewer as a program of its own: found on PATH, its version checked, fed through its standard input.

use std::net::{Ipv4Addr, TcpListener};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};

use anyhow::{Context, bail};

/// The version whose format is written here.
pub const VERSION: &str = "0.36.3";

/// The one command that installs the viewer.
pub const INSTALL: &str = "pip install rerun-sdk==0.36.3";

/// What a viewer is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A window.
    Window,
    /// A page that a browser opens.
    Web,
}

/// Looks for the viewer on PATH and checks that it reads what is written here.
///
/// # Errors
/// One sentence with the install command where it is missing or of another version.
pub fn find() -> anyhow::Result<PathBuf> {
    let path = std::env::var_os("PATH").unwrap_or_default();
    let name = format!("rerun{}", std::env::consts::EXE_SUFFIX);
    let Some(found) = std::env::split_paths(&path)
        .map(|folder| folder.join(&name))
        .find(|file| file.is_file())
    else {
        bail!(
            "the Rerun viewer was not found on PATH; install it with `{INSTALL}`, or write a file with --save FILE.rrd"
        );
    };
    let output = Command::new(&found)
        .arg("--version")
        .stdin(Stdio::null())
        .output()
        .with_context(|| format!("{}: cannot be run", found.display()))?;
    let said = String::from_utf8_lossy(&output.stdout);
    match version(&said) {
        Some(version) if compatible(version) => Ok(found),
        version => bail!(
            "{}: is version {}, but this program writes for Rerun {VERSION}; install that with `{INSTALL}`",
            found.display(),
            version.unwrap_or("unknown")
        ),
    }
}

/// The version in what `rerun --version` says: `rerun-cli 0.36.3 [rustc …] …`.
fn version(said: &str) -> Option<&str> {
    said.split_whitespace()
        .find(|word| word.starts_with(|c: char| c.is_ascii_digit()) && word.contains('.'))
}

/// Rerun reads files of its own minor version and of older ones, blueprints of its own only.
fn compatible(version: &str) -> bool {
    let minor =
        |version: &str| -> Vec<String> { version.split('.').take(2).map(str::to_owned).collect() };
    minor(version) == minor(VERSION)
}

/// Where the viewer's page is usually found.
const WEB_PORT: u16 = 9090;

/// The port if nobody has it, else 0, for which the viewer takes a free one: a second page does not end the first, nor the first a second.
fn free_or_any(port: u16) -> u16 {
    TcpListener::bind((Ipv4Addr::LOCALHOST, port)).map_or(0, |_| port)
}

/// How many threads the viewer computes with: it reads the pipe in one of them, and with that one alone it would show nothing before the end.
fn threads() -> usize {
    const LEAST: usize = 4;
    std::thread::available_parallelism().map_or(LEAST, |n| n.get().max(LEAST))
}

/// Starts the viewer; it shows what comes through the pipe.
///
/// # Errors
/// Where the viewer cannot be started.
pub fn start(program: &Path, kind: Kind) -> anyhow::Result<(Child, ChildStdin)> {
    let mut command = Command::new(program);
    // What is shown is nobody else's: only this machine may ask for it.
    command
        .args([
            "-",
            "--bind",
            "127.0.0.1",
            "--threads",
            &threads().to_string(),
            "--port",
            "auto",
        ])
        .stdin(Stdio::piped())
        .stdout(Stdio::null());
    match kind {
        Kind::Window => command.arg("--hide-welcome-screen"),
        Kind::Web => {
            let port = free_or_any(WEB_PORT).to_string();
            command.args(["--serve-web", "--web-viewer-port", &port])
        }
    };
    let mut child = command
        .spawn()
        .with_context(|| format!("{}: cannot be started", program.display()))?;
    let stdin = child
        .stdin
        .take()
        .context("the viewer has no standard input")?;
    Ok((child, stdin))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_version_is_found_in_what_the_viewer_says() {
        let said = "rerun-cli 0.36.3 [rustc 1.92.0 (ded5c06cf 2025-12-08), LLVM 21.1.3] x86_64-unknown-linux-gnu release-0.36.3 1234567";
        assert_eq!(version(said), Some("0.36.3"));
        assert_eq!(version("something else"), None);
        assert!(compatible("0.36.0") && compatible("0.36.9-alpha.1+dev"));
        assert!(!compatible("0.35.3") && !compatible("1.36.3") && !compatible("0.3"));
    }

    #[test]
    fn a_port_that_is_taken_is_left_to_whoever_has_it() {
        let held = || {
            let holder = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
            let port = holder.local_addr().unwrap().port();
            (holder, port)
        };
        let (_holder, port) = held();
        assert_eq!(free_or_any(port), 0);
        // Others of this machine may take one that was just let go.
        let is_found_free = |_| {
            let (holder, port) = held();
            drop(holder);
            free_or_any(port) == port
        };
        assert!((0..20).any(is_found_free));
    }

    #[test]
    fn the_version_is_the_one_compiled_in() {
        let [major, minor, patch] = {
            let v = re_log_encoding::CrateVersion::LOCAL;
            [v.major, v.minor, v.patch]
        };
        assert_eq!(VERSION, format!("{major}.{minor}.{patch}"));
        assert!(INSTALL.ends_with(VERSION));
    }
}
