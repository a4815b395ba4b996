//! A headless Chromium, told what to do over its debugging pipe: JSON messages that end with a zero byte.

use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use tests::on_path;

/// How long an answer may take on a busy machine.
const PATIENCE: Duration = Duration::from_secs(60);

/// The browser; it ends with this.
pub struct Browser {
    process: Child,
    input: ChildStdin,
    answers: Receiver<Value>,
    number: u64,
    /// What the pages did unasked since they were opened.
    events: Vec<Value>,
    _home: tempfile::TempDir,
}

/// How a page is looked at.
#[derive(Clone, Copy)]
pub struct Look {
    /// Width of the window, px.
    pub width: u32,
    /// `screen` or `print`.
    pub media: &'static str,
    /// `light` or `dark`.
    pub scheme: &'static str,
}

impl Browser {
    /// Starts it; `None`, with a note, where there is none.
    pub fn start() -> Option<Self> {
        let names = ["chromium", "chromium-browser", "google-chrome"];
        let Some(program) = on_path(&names) else {
            eprintln!("skipped: none of {names:?} is on PATH");
            return None;
        };
        let home = tempfile::tempdir().expect("a folder");
        // The pipe is asked for as descriptors 3 and 4.
        let mut process = Command::new("sh")
            .args(["-c", "exec \"$0\" \"$@\" 3<&0 4>&1 >/dev/null"])
            .arg(program)
            .args([
                "--headless=new",
                "--no-sandbox",
                "--disable-gpu",
                "--disable-dev-shm-usage",
                "--disable-background-networking",
                "--no-first-run",
                "--host-resolver-rules=MAP * ~NOTFOUND",
                "--remote-debugging-pipe",
            ])
            .arg(format!("--user-data-dir={}", home.path().display()))
            .env("HOME", home.path())
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .expect("the shell starts");
        let input = process.stdin.take().expect("a pipe");
        let mut output = BufReader::new(process.stdout.take().expect("a pipe"));
        let (sender, answers) = channel();
        std::thread::spawn(move || {
            let mut bytes = Vec::new();
            while output.read_until(0, &mut bytes).is_ok_and(|n| n > 0) {
                bytes.pop();
                let Ok(message) = serde_json::from_slice(&bytes) else {
                    return;
                };
                if sender.send(message).is_err() {
                    return;
                }
                bytes.clear();
            }
        });
        Some(Browser {
            process,
            input,
            answers,
            number: 0,
            events: Vec::new(),
            _home: home,
        })
    }

    fn call(&mut self, session: Option<&str>, method: &str, parameters: Value) -> Value {
        self.number += 1;
        let mut message = json!({ "id": self.number, "method": method, "params": parameters });
        if let Some(session) = session {
            message["sessionId"] = json!(session);
        }
        let mut bytes = message.to_string().into_bytes();
        bytes.push(0);
        self.input.write_all(&bytes).expect("the browser listens");
        self.input.flush().expect("the browser listens");
        loop {
            let answer = self
                .answers
                .recv_timeout(PATIENCE)
                .unwrap_or_else(|e| panic!("{method}: the browser does not answer ({e})"));
            if answer["id"] == json!(self.number) {
                assert!(answer["error"].is_null(), "{method}: {}", answer["error"]);
                return answer["result"].clone();
            }
            self.events.push(answer);
        }
    }

    /// Opens a file in a page of its own and waits until its script says that it is ready.
    pub fn open(&mut self, file: &Path, look: Look) -> Page<'_> {
        let target = self.call(None, "Target.createTarget", json!({ "url": "about:blank" }));
        let attach = json!({ "targetId": target["targetId"], "flatten": true });
        let session = self.call(None, "Target.attachToTarget", attach)["sessionId"]
            .as_str()
            .expect("a session")
            .to_owned();
        self.events.clear();
        let mut page = Page {
            browser: self,
            session,
        };
        for domain in ["Page", "Runtime", "Log", "Network"] {
            page.call(&format!("{domain}.enable"), json!({}));
        }
        page.look(look);
        let url = format!("file://{}", file.display());
        page.call("Page.navigate", json!({ "url": url }));
        let end = Instant::now() + PATIENCE;
        while page.evaluate("document.body?.dataset.ready ?? null") != json!("yes") {
            assert!(Instant::now() < end, "{url}: never got ready");
            std::thread::sleep(Duration::from_millis(50));
        }
        page
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        // Closing the pipe is how it is told to end; it may be gone already.
        let _ = self
            .input
            .write_all(b"{\"id\":0,\"method\":\"Browser.close\"}\0");
        let end = Instant::now() + Duration::from_secs(10);
        while matches!(self.process.try_wait(), Ok(None)) {
            if Instant::now() > end {
                let _ = self.process.kill();
                let _ = self.process.wait();
                return;
            }
            std::thread::sleep(Duration::from_millis(20));
        }
    }
}

/// One page.
pub struct Page<'b> {
    browser: &'b mut Browser,
    session: String,
}

impl Page<'_> {
    /// Sends a command of the debugging protocol.
    pub fn call(&mut self, method: &str, parameters: Value) -> Value {
        let session = self.session.clone();
        self.browser.call(Some(&session), method, parameters)
    }

    /// Changes window and media.
    pub fn look(&mut self, look: Look) {
        let scheme = json!([{ "name": "prefers-color-scheme", "value": look.scheme }]);
        self.call(
            "Emulation.setEmulatedMedia",
            json!({ "media": look.media, "features": scheme }),
        );
        self.call(
            "Emulation.setDeviceMetricsOverride",
            json!({ "width": look.width, "height": 900, "deviceScaleFactor": 1, "mobile": look.width < 600 }),
        );
        // The page hears of its width before the next frame, and draws then.
        self.evaluate("new Promise(r => requestAnimationFrame(() => requestAnimationFrame(r)))");
    }

    /// The value of an expression, of a promise when it is kept.
    pub fn evaluate(&mut self, expression: &str) -> Value {
        let asked =
            json!({ "expression": expression, "returnByValue": true, "awaitPromise": true });
        let answer = self.call("Runtime.evaluate", asked);
        assert!(
            answer["exceptionDetails"].is_null(),
            "{expression}: {answer}"
        );
        answer["result"]["value"].clone()
    }

    /// Moves, presses and releases the mouse from one place to another.
    pub fn drag(&mut self, from: [f64; 2], to: [f64; 2]) {
        for (kind, [x, y], buttons) in [
            ("mouseMoved", from, 0),
            ("mousePressed", from, 1),
            ("mouseMoved", to, 1),
            ("mouseReleased", to, 0),
        ] {
            let button = if kind == "mouseMoved" { "none" } else { "left" };
            self.call(
                "Input.dispatchMouseEvent",
                json!({ "type": kind, "x": x, "y": y, "button": button, "buttons": buttons, "clickCount": 1 }),
            );
        }
    }

    /// What the console, the log and scripts complained of, and every address that was asked for.
    pub fn complaints_and_requests(&mut self) -> (Vec<String>, Vec<String>) {
        self.evaluate("0");
        let (mut complaints, mut requests) = (Vec::new(), Vec::new());
        for event in &self.browser.events {
            let said = &event["params"];
            match event["method"].as_str() {
                Some("Runtime.exceptionThrown" | "Log.entryAdded") => {
                    complaints.push(said.to_string())
                }
                Some("Runtime.consoleAPICalled") => complaints.push(said["args"].to_string()),
                Some("Network.requestWillBeSent") => {
                    requests.push(said["request"]["url"].as_str().unwrap_or("").to_owned())
                }
                _ => {}
            }
        }
        (complaints, requests)
    }
}
