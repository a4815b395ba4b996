//! The HTML report as a browser shows it: headless Chromium, where there is one on PATH.

mod browser;

use std::path::PathBuf;

use browser::{Browser, Look, Page};
use serde_json::{Value, json};
use tests::{good, run_in};

const SCREEN: Look = Look {
    width: 1440,
    media: "screen",
    scheme: "light",
};

/// A run of a scene, its report, and the numbers that `analyze` prints of it.
struct Made {
    folder: tempfile::TempDir,
    page: PathBuf,
    numbers: Value,
}

fn made() -> Made {
    made_of("music")
}

fn made_of(scene: &str) -> Made {
    let folder = tempfile::tempdir().expect("a folder");
    let command = |name: &str, args: &[&str]| good(run_in(folder.path(), name, args));
    let [recording, page] = ["mcap", "html"].map(|e| format!("{scene}.{e}"));
    command("sim", &["record", scene, "--out", &recording]);
    let args = [&recording, "--report", &page, "--format", "json"];
    let numbers = tests::json(&command("analyze", &args));
    let page = folder.path().join(page);
    Made {
        folder,
        page,
        numbers,
    }
}

/// Plots as the page drew them: title, kind, and for every curve its points, said and drawn.
const PLOTS: &str = r#"[...document.querySelectorAll("figure[data-plot]")].map(f => ({
  title: f.querySelector("h3").textContent,
  curves: [...f.querySelectorAll(".curve")].map(c => [Number(c.dataset.points), (c.getAttribute("d").match(/[ML]/g) || []).length]),
  cells: Number(f.querySelector("image")?.dataset.points ?? 0),
}))"#;

/// Words of the plots that stand outside their drawing, and what is wider than the window.
const CLIPPED: &str = r#"[...document.querySelectorAll("figure[data-plot] svg")].flatMap(svg => {
  const out = svg.getBoundingClientRect();
  return [...svg.querySelectorAll("text")].filter(t => {
    const r = t.getBoundingClientRect();
    return r.width > 0 && (r.left < out.left - 1 || r.right > out.right + 1 || r.top < out.top - 1 || r.bottom > out.bottom + 1);
  }).map(t => svg.getAttribute("aria-label") + ": " + t.textContent);
}).concat(document.documentElement.scrollWidth > window.innerWidth ? ["the page itself"] : [])"#;

/// Names of the marks and ticks of a plot that lie over each other.
const OVERLAPPING: &str = r#"[...document.querySelectorAll("figure[data-plot] svg")].flatMap(svg => {
  const boxes = [...svg.querySelectorAll("text")].map(t => [t.textContent, t.getBoundingClientRect()]).filter(([, r]) => r.width > 0);
  return boxes.flatMap(([a, p], i) => boxes.slice(i + 1).filter(([, q]) =>
    Math.min(p.right, q.right) - Math.max(p.left, q.left) > 2 && Math.min(p.bottom, q.bottom) - Math.max(p.top, q.top) > 4)
    .map(([b]) => svg.getAttribute("aria-label") + ": " + a + " / " + b));
})"#;

/// Plots in which nothing is drawn, and those of which two ticks of an axis say the same.
const SAYS_NOTHING: &str = r#"[...document.querySelectorAll("figure[data-plot] svg")].flatMap(svg => {
  const drawn = svg.querySelector("image") || [...svg.querySelectorAll(".curve")].some(c => c.getAttribute("d"));
  const up = [...svg.querySelectorAll('text[text-anchor="end"]:not(.note)')].map(t => t.textContent);
  return drawn && up.length > 1 && new Set(up).size === up.length ? [] : [svg.getAttribute("aria-label") + ": " + up];
})"#;

/// Curves in planes that leave their drawing, or lie on its frame.
const ON_THE_FRAME: &str = r#"[...document.querySelectorAll("figure:not(.wide) svg")].filter(svg => svg.getAttribute("aria-label").match(/portrait|against/)).filter(svg => {
  const [curve, frame] = [svg.querySelector(".curve").getBBox(), svg.querySelector("clipPath rect").getBBox()];
  return curve.x < frame.x + 5 || curve.x + curve.width > frame.x + frame.width - 5;
}).map(svg => svg.getAttribute("aria-label"))"#;

/// Levels that a curve covers.
const COVERED: &str = r#"[...document.querySelectorAll("figure[data-plot] svg")].filter(svg => {
  const [curve, level] = [[...svg.querySelectorAll(".curve")].pop(), svg.querySelector(".level")];
  return level && !(curve.compareDocumentPosition(level) & Node.DOCUMENT_POSITION_FOLLOWING);
}).map(svg => svg.getAttribute("aria-label"))"#;

/// Lightness of a computed colour, 0 to 1: `rgb(r, g, b)`.
fn lightness(page: &mut Page<'_>, selector: &str, property: &str) -> f64 {
    let expression = format!(
        "getComputedStyle(document.querySelector({selector:?})).{property}.match(/[\\d.]+/g).slice(0, 3).map(Number)"
    );
    let rgb: Vec<f64> = serde_json::from_value(page.evaluate(&expression)).expect("three numbers");
    (0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2]) / 255.0
}

fn drawn(page: &mut Page<'_>) -> Vec<(String, Vec<[u64; 2]>, u64)> {
    let plots = page.evaluate(PLOTS);
    let one = |plot: &Value| {
        let curves = serde_json::from_value(plot["curves"].clone()).expect("pairs of numbers");
        (
            plot["title"].as_str().expect("a title").to_owned(),
            curves,
            plot["cells"].as_u64().expect("a count"),
        )
    };
    plots.as_array().expect("plots").iter().map(one).collect()
}

#[track_caller]
fn nothing(page: &mut Page<'_>, expression: &str, what: &str) {
    assert_eq!(page.evaluate(expression), json!([]), "{what}");
}

#[test]
fn the_report_draws_every_point_and_asks_nobody() {
    let Some(mut browser) = Browser::start() else {
        return;
    };
    let made = made();
    let bytes = std::fs::metadata(&made.page).expect("written").len();
    assert!(bytes < 3_000_000, "{bytes} bytes");
    let mut page = browser.open(&made.page, SCREEN);

    // Every sample of the run is a point of its curve; of the planes, every sample of the window.
    let samples = made.numbers["samples"].as_u64().expect("a count");
    let window: Vec<f64> =
        serde_json::from_value(made.numbers["window_s"].clone()).expect("two numbers");
    let inside = ((window[1] - window[0]) * 30.0).round() as u64 + 1;
    let plots = drawn(&mut page);
    let expected: [(&str, usize, Option<u64>); 12] = [
        ("Roll and tilt", 2, Some(samples)),
        ("Height of the centre of mass", 1, Some(samples)),
        ("Normal forces of the handles", 2, Some(samples)),
        ("Support over weight", 1, Some(samples)),
        ("Synchrony of the carriers", 1, Some(samples)),
        ("Stored energy", 3, Some(samples)),
        ("Energy ledger", 3, Some(samples)),
        ("Spectrum of the roll", 1, None),
        ("Spectrum of the height", 1, None),
        ("Spectrogram of the roll", 0, None),
        ("Phase portrait of the roll", 1, Some(inside)),
        ("One handle against the other", 1, Some(inside)),
    ];
    let titles: Vec<&str> = plots.iter().map(|(title, ..)| title.as_str()).collect();
    assert_eq!(titles, expected.map(|(title, ..)| title));
    for ((title, curves, cells), (_, count, points)) in plots.iter().zip(expected) {
        assert_eq!(curves.len(), count, "{title}");
        for [said, in_path] in curves {
            assert_eq!(said, in_path, "{title}: not every point is drawn");
            match points {
                Some(points) => assert_eq!(*said, points, "{title}"),
                None => assert!(*said > 50, "{title}: {said}"),
            }
        }
        assert_eq!(*cells > 1000, count == 0, "{title}: {cells} cells");
    }
    let text = page.evaluate("document.body.innerText");
    let text = text.as_str().expect("text");
    let rolls = made.numbers["metrics"]["rms_roll_deg"]["value"].as_f64();
    let rolls = format!("{:.3}", rolls.expect("a number"));
    let command = "analyze music.mcap --report music.html --format json";
    for word in [command, &rolls[..4], "parametric", "onset"] {
        assert!(text.contains(word), "{word}");
    }

    let (complaints, requests) = page.complaints_and_requests();
    assert_eq!(complaints, [""; 0]);
    let own = format!("file://{}", made.page.display());
    for url in requests {
        assert!(url == own || url.starts_with("data:"), "asked for {url}");
    }
}

#[test]
fn the_report_fits_phones_screens_paper_and_the_dark() {
    let Some(mut browser) = Browser::start() else {
        return;
    };
    let made = made();
    let mut page = browser.open(&made.page, SCREEN);
    for width in [360, 768, 1440] {
        page.look(Look { width, ..SCREEN });
        nothing(&mut page, CLIPPED, &format!("clipped at {width} px"));
        nothing(&mut page, OVERLAPPING, &format!("unreadable at {width} px"));
        assert!(lightness(&mut page, "body", "backgroundColor") > 0.9);
        assert!(lightness(&mut page, "svg text", "fill") < 0.2);
        nothing(&mut page, ON_THE_FRAME, &format!("cut at {width} px"));
        nothing(&mut page, COVERED, "levels under curves");
    }
    let blue = lightness(&mut page, ".curve", "stroke");
    let dark = Look {
        scheme: "dark",
        ..SCREEN
    };
    page.look(dark);
    assert!(lightness(&mut page, "body", "backgroundColor") < 0.15);
    assert!(lightness(&mut page, "body", "color") > 0.7);
    assert!(lightness(&mut page, "svg text", "fill") > 0.7);
    // The first colour, a deep blue, would not be seen on dark paper.
    assert!(lightness(&mut page, ".curve", "stroke") > blue + 0.1);
    // Paper is white whatever the screen is, and shows the definitions that a click opens elsewhere, and no buttons.
    page.look(Look {
        width: 720,
        media: "print",
        ..dark
    });
    assert!(lightness(&mut page, "body", "color") < 0.2);
    assert_eq!(lightness(&mut page, ".curve", "stroke"), blue);
    nothing(&mut page, CLIPPED, "clipped in print");
    let hidden = "getComputedStyle(document.querySelector('button')).display";
    assert_eq!(page.evaluate(hidden), json!("none"));
    // What a click opens elsewhere is open on paper, whose width the plots have, and closed again on the screen.
    let definition = "document.querySelector('.metrics details p').checkVisibility()";
    let drawing = "document.querySelector('figure svg').getAttribute('viewBox')";
    let on_screen = page.evaluate(drawing);
    assert_eq!(page.evaluate(definition), json!(false));
    page.evaluate("window.dispatchEvent(new Event('beforeprint'))");
    assert_eq!(page.evaluate(definition), json!(true));
    assert_eq!(page.evaluate(drawing), json!("0 0 700 230"));
    nothing(&mut page, CLIPPED, "clipped on paper");
    nothing(&mut page, OVERLAPPING, "unreadable on paper");
    page.evaluate("window.dispatchEvent(new Event('afterprint'))");
    assert_eq!(page.evaluate(definition), json!(false));
    assert_eq!(page.evaluate(drawing), on_screen);
    // The spectrogram's colours have a key, which paper shows too.
    let key = page.evaluate("document.querySelector('.map').parentElement.textContent");
    assert!(
        key.as_str().is_some_and(|k| k.ends_with("dB re 1 deg²/Hz")),
        "{key}"
    );
    let swatch = "getComputedStyle(document.querySelector('.legend i')).printColorAdjust";
    assert_eq!(page.evaluate(swatch), json!("exact"));
    drop(made.folder);
}

#[test]
fn a_rath_at_rest_shows_no_rounding() {
    let Some(mut browser) = Browser::start() else {
        return;
    };
    let still = made_of("stand-still");
    let mut page = browser.open(&still.page, SCREEN);
    nothing(&mut page, OVERLAPPING, "unreadable");
    nothing(&mut page, SAYS_NOTHING, "says nothing");
    let titles: Vec<String> = drawn(&mut page).into_iter().map(|(t, ..)| t).collect();
    let moving = |t: &&String| {
        ["Spectr", "portrait", "against", "ledger"]
            .iter()
            .any(|m| t.contains(m))
    };
    assert_eq!(titles.iter().find(moving), None);
    // One sample is seen, is one sample, and has no table of metrics without metrics.
    let folder = still.folder.path();
    let short = [
        "record",
        "stand-still",
        "--duration",
        "0.001",
        "--out",
        "one.mcap",
    ];
    good(run_in(folder, "sim", &short));
    good(run_in(
        folder,
        "analyze",
        &["one.mcap", "--report", "one.html"],
    ));
    let mut page = browser.open(&folder.join("one.html"), SCREEN);
    nothing(&mut page, SAYS_NOTHING, "says nothing");
    let header = page.evaluate("document.querySelector('header').textContent");
    assert!(
        header.as_str().is_some_and(|h| h.contains(" 1 sample;")),
        "{header}"
    );
    let dot = page.evaluate("getComputedStyle(document.querySelector('.curve')).strokeWidth");
    assert_eq!(dot, json!("6px"));
}

#[test]
fn a_report_says_first_what_it_knows_and_why_it_knows_no_more() {
    let Some(mut browser) = Browser::start() else {
        return;
    };
    let made = made();
    let whole = std::fs::read(made.folder.path().join("music.mcap")).expect("a file");
    let half = made.folder.path().join("half.mcap");
    std::fs::write(&half, &whole[..whole.len() / 2]).expect("written");
    let args = ["half.mcap", "--report", "half.html"];
    let done = run_in(made.folder.path(), "analyze", &args);
    assert_eq!(done.status.code(), Some(3));
    let mut page = browser.open(&made.folder.path().join("half.html"), SCREEN);
    let warned =
        page.evaluate("[...document.querySelectorAll('header .warn')].map(p => p.textContent)");
    let warned: Vec<String> = serde_json::from_value(warned).expect("texts");
    assert!(
        matches!(&warned[..], [only] if only.starts_with("The file is damaged; its end is missing")),
        "{warned:?}"
    );

    let mut page = browser.open(&made.page, SCREEN);
    let mut text = |selector: &str| {
        let text = page.evaluate(&format!("document.querySelector({selector:?}).textContent"));
        text.as_str().expect("text").to_owned()
    };
    let large = made.numbers["metrics"]["rms_roll_deg"]["value"].as_f64();
    let large = format!("{:.1}", large.expect("a number"));
    assert_eq!(text(".tile:nth-child(2) b"), large);
    assert!(
        !text(".metrics tbody").contains('–'),
        "no value, unsaid why"
    );
    assert!(text("#missing").contains("no carrier's steps in the recording"));
    let events = text("#events + details > summary");
    assert!(
        events.contains(" × contact lost") && events.contains("1 × onset"),
        "{events}"
    );
    // The header of what `sim` writes has no profile.
    assert!(!text("#recording + p").contains("“”"));
}

#[test]
fn time_axes_move_together() {
    let Some(mut browser) = Browser::start() else {
        return;
    };
    let made = made();
    let mut page = browser.open(&made.page, SCREEN);
    let whole = drawn(&mut page);
    let corner = page.evaluate(
        "(() => { const r = document.querySelector('figure svg').getBoundingClientRect(); return [r.left, r.top, r.width, r.height]; })()",
    );
    let [left, top, width, height]: [f64; 4] =
        serde_json::from_value(corner).expect("four numbers");
    let at = |share: f64| [left + share * width, top + 0.5 * height];
    page.drag(at(0.4), at(0.5));
    let near = drawn(&mut page);
    for ((title, before, _), (_, after, _)) in whole.iter().zip(&near) {
        for (b, a) in before.iter().zip(after) {
            let [b, a] = [b[0], a[0]];
            if b == whole[0].1[0][0] {
                // A tenth of the drawing's width is a little more than a tenth of the axis.
                assert!(a > b / 12 && a < b / 8, "{title}: {a} of {b}");
            } else {
                assert_eq!(a, b, "{title}: is not over time");
            }
        }
    }
    page.evaluate("document.querySelector('#reset').click()");
    assert_eq!(drawn(&mut page), whole);
    // The legend says the values under the pointer, in every plot over time.
    page.drag(at(0.5), at(0.5));
    let said = page.evaluate(
        "[...document.querySelectorAll('.legend')].filter(l => l.querySelector('.value')).length",
    );
    assert_eq!(said, json!(8), "seven plots over time and the spectrogram");
}
