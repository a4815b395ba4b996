//! `view`: opens a recording in the Rerun viewer, or writes what it would show.

use std::io::{BufWriter, Chain, Cursor, ErrorKind, Read, Stdin, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;

use analyze::request::Request;
use analyze::roles::RolesFile;
use anyhow::{Context, anyhow, bail};
use clap::Parser;
use recording::Finding;
use recording::read::{ReadError, Recording, STDIN};
use recording::whole::{Output, Usage, may_write, write_whole};
use view::load::{Detail, load, options};
use view::store::{Encoded, Sink};
use view::take::Take;
use view::viewer::{self, Kind};

/// Look at a recording in the Rerun viewer: the scene in space, phases on the circle, forces, angles, spectra and events.
#[derive(Parser)]
#[command(version, about, after_help = help())]
struct Arguments {
    /// The recording (MCAP), or - for one that comes through standard input and is shown while it grows
    #[arg(value_name = "FILE.mcap|-")]
    file: PathBuf,
    /// A TOML file that says which signal plays which role, as for `analyze`
    #[arg(long, value_name = "FILE.toml")]
    roles: Option<PathBuf>,
    /// Metrics and spectra from A to B, seconds after the first message: 15..60, 15.. or ..60
    #[arg(long, value_name = "A..B", value_parser = analyze::window::parse, allow_hyphen_values = true)]
    window: Option<(Option<f64>, Option<f64>)>,
    /// Write what would be shown as a Rerun file, and open nothing
    #[arg(long, value_name = "FILE.rrd", group = "target")]
    save: Option<PathBuf>,
    /// Serve the viewer as a web page from this machine until interrupted
    #[arg(long, group = "target")]
    web: bool,
    /// Send to a viewer or server that runs already, such as rerun+http://127.0.0.1:9876/proxy
    #[arg(long, value_name = "URL", group = "target")]
    connect: Option<String>,
}

/// Who does not answer within this does not.
const ANSWERS: Duration = Duration::from_secs(5);

/// Exit code where the input was damaged and what could be saved was used.
const DAMAGED: u8 = 3;

/// What stands below the options.
fn help() -> String {
    format!(
        "Examples:
  view music.mcap                         open it in the Rerun viewer
  view music.mcap --save music.rrd        write a file for the viewer; needs no viewer
  view walk.mcap --roles roles.toml       a field log, with what `analyze` is told of it, too
  view music.mcap --web                   in a browser: the viewer says the address
  sim record music --out - | view -       watch a run while it is computed

The viewer is a program of its own: {}

Exit codes: 0 done; 1 it could not; 2 wrong usage; 3 done, but the input was damaged and part of it is lost.",
        viewer::INSTALL
    )
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    match run(&arguments) {
        Ok(findings) => report(&label(&arguments.file), &findings),
        Err(error) => {
            recording::note!("view: {error:#}");
            match error.is::<Usage>() {
                true => ExitCode::from(2),
                false => ExitCode::FAILURE,
            }
        }
    }
}

/// Says what was lost of the input.
fn report(name: &str, findings: &[Finding]) -> ExitCode {
    let lost: Vec<&Finding> = findings.iter().filter(|f| f.kind.is_loss()).collect();
    for finding in &lost {
        recording::note!("view: {name}: {finding}");
    }
    if lost.is_empty() {
        ExitCode::SUCCESS
    } else {
        ExitCode::from(DAMAGED)
    }
}

fn run(arguments: &Arguments) -> anyhow::Result<Vec<Finding>> {
    let asked = asked(arguments)?;
    if let Some(path) = &arguments.save {
        if path.as_os_str() == "-" {
            let said = "--save -: an .rrd is written to a file; give it a name";
            return Err(Usage(said.into()).into());
        }
        let output = Output {
            option: "--save",
            path,
            endings: &["rrd"],
        };
        may_write(&[output], [arguments.file.as_path()])?;
        return save(&arguments.file, path, &asked);
    }
    if let Some(url) = &arguments.connect {
        return connect(&arguments.file, url, &asked);
    }
    let kind = if arguments.web {
        Kind::Web
    } else {
        Kind::Window
    };
    show(&arguments.file, kind, &asked)
}

/// What the user says of the recording.
fn asked(arguments: &Arguments) -> anyhow::Result<Request> {
    let roles = arguments.roles.as_deref().map(RolesFile::read);
    Ok(Request {
        roles: roles.transpose().map_err(anyhow::Error::msg)?,
        window: arguments.window.unwrap_or_default(),
        ..Request::default()
    })
}

fn is_stdin(file: &Path) -> bool {
    file.as_os_str() == "-"
}

/// Opens a recording that is complete.
fn open(file: &Path, asked: &Request) -> anyhow::Result<Recording> {
    if !is_stdin(file) {
        return Ok(Recording::open(file, &options(asked))?);
    }
    let mut input = std::io::stdin().lock();
    Ok(Recording::from_stream(&mut input, STDIN, &options(asked))?)
}

/// What messages call the input: as it was given.
fn label(file: &Path) -> String {
    if is_stdin(file) {
        return STDIN.to_owned();
    }
    file.display().to_string()
}

/// Name for people: the file's, without folders and ending.
fn name(file: &Path) -> String {
    if is_stdin(file) {
        return STDIN.to_owned();
    }
    file.file_stem().map_or_else(
        || file.display().to_string(),
        |stem| stem.to_string_lossy().into_owned(),
    )
}

/// An input that is a recording. What is wrong with it is said before what is wrong with a viewer.
enum Input {
    /// A file.
    Whole(Box<Recording>),
    /// Coming through standard input; its beginning has been read.
    Growing(Chain<Cursor<Vec<u8>>, Stdin>),
}

/// What is to be shown, found good before anything is opened for it.
enum Source {
    /// Read from a file, with its id.
    Whole(Box<Take>, String, Vec<Finding>),
    /// Coming through standard input.
    Growing(Chain<Cursor<Vec<u8>>, Stdin>),
}

/// Bytes by which an MCAP is known.
const MAGIC_BYTES: u64 = 8;

/// Opens a file, or reads the beginning of standard input.
fn input(file: &Path, asked: &Request) -> anyhow::Result<Input> {
    if is_stdin(file) {
        let mut begin = Vec::new();
        std::io::stdin()
            .lock()
            .take(MAGIC_BYTES)
            .read_to_end(&mut begin)
            .with_context(|| format!("{STDIN}: cannot be read"))?;
        match Recording::from_bytes(begin.clone(), &options(asked)) {
            Err(error @ ReadError::NotMcap { .. }) => return Err(error.into()),
            Err(error) if begin.is_empty() => return Err(error.into()),
            _ => {}
        }
        return Ok(Input::Growing(Cursor::new(begin).chain(std::io::stdin())));
    }
    Ok(Input::Whole(Box::new(open(file, asked)?)))
}

/// Reads a file.
fn source(file: &Path, input: Input, asked: &Request) -> anyhow::Result<Source> {
    let recording = match input {
        Input::Whole(recording) => recording,
        Input::Growing(input) => return Ok(Source::Growing(input)),
    };
    let (take, findings) = load(&name(file), &recording, Detail::Thinned, asked)?;
    check(file, &take, &findings)?;
    let id = view::recording_id(&take.name, &recording);
    Ok(Source::Whole(Box::new(take), id, findings))
}

/// Sends a recording that is complete, or one that comes through standard input as it comes.
fn send(
    file: &Path,
    source: Source,
    sink: &mut dyn Sink,
    asked: &Request,
) -> anyhow::Result<Vec<Finding>> {
    match source {
        Source::Whole(take, id, findings) => {
            view::send(sink, &id, &take)?;
            Ok(findings)
        }
        Source::Growing(input) => {
            let (take, findings) = view::live::follow(input, sink, asked)?;
            check(file, &take, &findings)?;
            Ok(findings)
        }
    }
}

/// A recording without any number has nothing to look at; what the reader found odd may be why.
fn check(file: &Path, take: &Take, findings: &[Finding]) -> anyhow::Result<()> {
    let nothing = take.state_ns.is_empty()
        && take.force_ns.is_empty()
        && take.phase_ns.is_empty()
        && take.energy.is_none()
        && take.imus.is_empty()
        && take.topics.is_empty();
    if nothing {
        let lost = findings.iter().find(|f| f.kind.is_loss());
        let why = lost.or(findings.first());
        let why = why.map_or(String::new(), |f| format!(". And {f}"));
        bail!(
            "{}: has nothing that can be shown by itself; expected a pose, forces, phases, an inertial sensor, or other numbers of more than one moment in protobuf, CDR, ROS 1 or JSON messages (`analyze` lists what is in it){why}",
            label(file)
        );
    }
    Ok(())
}

/// Writes an .rrd that appears whole or not at all.
fn save(file: &Path, path: &Path, asked: &Request) -> anyhow::Result<Vec<Finding>> {
    let cannot =
        |error: &dyn std::fmt::Display| anyhow!("{}: cannot be written: {error}", path.display());
    let recording = open(file, asked)?;
    let (take, findings) = load(&name(file), &recording, Detail::Thinned, asked)?;
    check(file, &take, &findings)?;
    write_whole(path, |file| {
        let mut encoded = Encoded::new(file)?;
        view::send(
            &mut encoded,
            &view::recording_id(&take.name, &recording),
            &take,
        )?;
        encoded.finish()?;
        anyhow::Ok(())
    })
    .map_err(|e| cannot(&e))?;
    Ok(findings)
}

/// Sends to a viewer or server that runs already.
fn connect(file: &Path, url: &str, asked: &Request) -> anyhow::Result<Vec<Finding>> {
    let parsed = url
        .parse()
        .map_err(|error| anyhow!("--connect: {url:?} is no address of Rerun ({error}); expected one such as rerun+http://127.0.0.1:9876/proxy"))?;
    let input = input(file, asked)?;
    let mut client = re_grpc_client::write::Client::new(
        answering(parsed, url)?,
        re_grpc_client::write::Options::default(),
    );
    let findings = send(file, source(file, input, asked)?, &mut client, asked)?;
    client
        .flush_blocking(Duration::from_secs(20))
        .map_err(|error| {
            anyhow!("{url}: did not take what was sent ({error}); is a viewer running there?")
        })?;
    Ok(findings)
}

/// The address, if somebody listens there: the client itself would wait for that without end.
fn answering(uri: re_uri::ProxyUri, url: &str) -> anyhow::Result<re_uri::ProxyUri> {
    let nobody = |why: &dyn std::fmt::Display| {
        anyhow!(
            "{url}: nobody answers there ({why}); start a viewer with `rerun`, or write a file with --save FILE.rrd"
        )
    };
    let place = format!("{}:{}", uri.origin.host, uri.origin.port);
    let mut last = None;
    for address in place.to_socket_addrs().map_err(|e| nobody(&e))? {
        match TcpStream::connect_timeout(&address, ANSWERS).and_then(greeted) {
            Ok(()) => return Ok(uri),
            Err(error) => last = Some(error),
        }
    }
    Err(last.map_or_else(|| nobody(&"the name has no address"), |e| nobody(&e)))
}

/// That something is said to a greeting of HTTP/2: its preface and empty settings (RFC 9113, 3.4).
fn greeted(mut peer: TcpStream) -> std::io::Result<()> {
    peer.set_read_timeout(Some(ANSWERS))?;
    peer.write_all(b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n\0\0\0\x04\0\0\0\0\0")?;
    match peer.read(&mut [0]) {
        Ok(0) => Err(std::io::Error::other(
            "what listens takes the connection and closes it",
        )),
        Ok(_) => Ok(()),
        Err(error) if error.kind() == ErrorKind::WouldBlock => Err(std::io::Error::other(
            "what listens takes the connection and says nothing",
        )),
        Err(error) => Err(error),
    }
}

/// Starts the viewer, sends the recording into it and waits until it is closed.
fn show(file: &Path, kind: Kind, asked: &Request) -> anyhow::Result<Vec<Finding>> {
    let input = input(file, asked)?;
    let program = viewer::find()?;
    // What cannot be read should not open a window first.
    let source = source(file, input, asked)?;
    let (mut child, stdin) = viewer::start(&program, kind)?;
    let sent = Encoded::stream(BufWriter::with_capacity(1 << 16, stdin)).and_then(|mut encoded| {
        let findings = send(file, source, &mut encoded, asked)?;
        encoded.finish()?.flush()?;
        Ok(findings)
    });
    let is_gone = |error: &anyhow::Error| {
        let mut io = error.chain().filter_map(|c| c.downcast_ref());
        io.any(|e: &std::io::Error| e.kind() == ErrorKind::BrokenPipe)
    };
    if sent.as_ref().is_err_and(is_gone) {
        let status = child.wait()?;
        bail!(
            "the Rerun viewer ended with {status} before it had taken everything; what it says itself stands above"
        );
    }
    if sent.is_err() && child.try_wait()?.is_none() {
        recording::note!(
            "view: not all could be read; the viewer shows what came before, until it is closed"
        );
        child.wait()?;
        return sent;
    }
    let status = child.wait()?;
    match sent {
        Ok(findings) if status.success() => Ok(findings),
        Ok(_) => bail!("the Rerun viewer ended with {status}; its own messages stand above"),
        Err(error) if status.code().is_some_and(|code| code != 0) => {
            Err(error.context(format!("the Rerun viewer ended with {status}")))
        }
        Err(error) => Err(error),
    }
}
