//! Rules of contact events: fired at the first zero of N* on (t₀, t₁], each once, to 1e-12 s; several at one moment; one at the start;
//! a touch that does not pass; a handle that stays on the edge.

mod common;

use common::{samples, scene};
use sim::model::Model;
use sim::run::{Listener, Sample, run_model};
use sim::scene::{Scene, builtin, parse};
use sim::solve::{Event, EventKind, METHODS, Method, Settings, method};

struct Heard(Vec<Event>, Vec<f64>);

impl Listener for Heard {
    fn sample(&mut self, sample: &Sample) -> bool {
        self.1.push(sample.pose.position_m[2]);
        true
    }
    fn event(&mut self, event: &Event) {
        self.0.push(event.clone());
    }
}

fn heard(text: &str, method: &Method) -> Heard {
    heard_at(1e-9, &scene(text), method)
}

fn heard_at(tolerance: f64, scene: &Scene, method: &Method) -> Heard {
    let settings = Settings {
        tolerance,
        step_s: f64::NAN,
        most_evaluations: 1 << 40,
    };
    let mut heard = Heard(Vec::new(), Vec::new());
    let (_, outcome) = run_model(&Model::new(scene), method, &settings, &mut heard);
    outcome.unwrap_or_else(|e| panic!("{}: {e}", method.name));
    heard
}

/// The methods that locate.
fn locating() -> impl Iterator<Item = &'static Method> {
    METHODS.iter().filter(|m| m.locates)
}

/// Dropped from `height_m` above springs without damping, which it meets as it passes shoulder height.
fn drop_from(height_m: f64, duration_s: f64) -> String {
    format!(
        "name = \"drop\"\nduration_s = {duration_s}\n[carriers]\nhandles_m = [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]]\n\
         [start]\nheight_m = {}\n[effects.contact]\ndamping_n_s_per_m = 0.0\n",
        1.0 + height_m
    )
}

#[test]
fn both_handles_land_and_leave_when_the_closed_form_says() {
    let (height, g, m, k) = (0.7_f64, 9.81_f64, 60.0_f64, 6000.0_f64);
    // Free fall, then half a swing about the static compression: z̈ = −g − (k/m) z below the shoulders.
    let land = (2.0 * height / g).sqrt();
    let (speed, omega, sag) = ((2.0 * g * height).sqrt(), (k / m).sqrt(), m * g / k);
    let leave = land + 2.0 * (std::f64::consts::PI - (speed / (omega * sag)).atan()) / omega;
    for method in locating() {
        let events = heard(&drop_from(height, 1.5), method).0;
        let expected = [
            (land, EventKind::ContactClosed),
            (leave, EventKind::ContactOpened),
        ];
        for (event, (t_s, kind)) in events.chunks(2).zip(expected) {
            assert_eq!(event.len(), 2, "{}: {events:?}", method.name);
            assert_eq!([event[0].handle, event[1].handle], [0, 1]);
            for e in event {
                assert_eq!(e.kind, kind, "{}: {events:?}", method.name);
                // The landing is exact but for rounding; the lift-off carries the error of the swing before it.
                let within = if kind == EventKind::ContactClosed {
                    1e-12
                } else {
                    1e-8
                };
                let off = (e.t_s - t_s).abs();
                assert!(off < within, "{}: {kind:?} off by {off:e} s", method.name);
            }
        }
    }
}

#[test]
fn an_event_at_the_start_is_none_and_the_motion_goes_on() {
    for method in locating() {
        // At shoulder height, at rest: N* = 0 at t = 0, then it sinks in and is thrown back up to the same height.
        let heard = heard(&drop_from(0.0, 2.0), method);
        let (events, heights) = (heard.0, heard.1);
        let period = 2.0 * std::f64::consts::PI * (60.0_f64 / 6000.0).sqrt();
        for (i, z) in heights.iter().enumerate() {
            let phase = 2.0 * std::f64::consts::PI * (i as f64 / 30.0) / period;
            let expected = 1.0 - 60.0 * 9.81 / 6000.0 * (1.0 - phase.cos());
            assert!((z - expected).abs() < 1e-7, "{}: z = {z}", method.name);
        }
        // Both close at the start. At the top of each swing N* touches zero: rounding decides whether it passes, and what opens closes at once.
        assert!(events.len() <= 2 + 4 * 3, "{}: {events:?}", method.name);
    }
}

#[test]
fn a_touch_from_above_is_no_event() {
    // Carried up and down so gently that N* stays a hair above zero, and a hair harder: the wave's own amplitude decides.
    let carried = |part: f64| {
        // One handle above the centre of mass; N* falls to (1 − part) M g at the top of the wave.
        let (omega, k, c, m) = (4.0 * std::f64::consts::PI, 3000.0, 400.0, 60.0_f64);
        // z = Re[H A e^{iωt}], H = (k + icω)/(k + icω − mω²), and N* − M g = m z̈.
        let (re, im) = (k - m * omega * omega, c * omega);
        let gain = ((k * k + c * c * omega * omega) / (re * re + im * im)).sqrt();
        let amplitude = part * 9.81 / (gain * omega * omega);
        format!(
            "name = \"wave\"\nduration_s = 20.0\n[carriers]\nhandles_m = [[0.0, 0.0, 0.0]]\n\
             [effects.contact]\nstiffness_n_per_m = {k:?}\ndamping_n_s_per_m = {c:?}\n[effects.gait]\namplitude_m = {amplitude:?}\n"
        )
    };
    for method in locating() {
        // The start at rest is a transient of its own: it may lift off, then it has died away after two seconds.
        let late = |part: f64| {
            let events = heard(&carried(part), method).0;
            events.iter().filter(|e| e.t_s > 4.0).count()
        };
        assert_eq!(late(1.0 - 1e-5), 0, "{}", method.name);
        // Two events in each of 32 periods of 0.5 s.
        assert_eq!(late(1.0 + 1e-5), 64, "{}", method.name);
    }
}

/// At a thousand times the stiffness and a tolerance of a tenth, what the steps err by keeps a handle at its edge for tens of microseconds:
/// it was told to open and close 78,000 times there. The motion has some 600 events.
#[test]
fn a_handle_that_comes_back_to_its_edge_is_held_there_longer() {
    let text = builtin("music").unwrap();
    let stiff = [
        "effects.contact.stiffness_n_per_m=3e6",
        "effects.contact.damping_n_s_per_m=12650",
    ];
    let scene = parse("music", text, &stiff.map(str::to_owned)).unwrap();
    for tolerance in [0.1, 0.05] {
        let radau15 = method("radau15").unwrap();
        let events = heard_at(tolerance, &scene, radau15).0.len();
        assert!((500..1500).contains(&events), "{tolerance}: {events}");
    }
}

/// Moments that are one but for rounding leave a step of that length between them, which says nothing about the next one.
#[test]
fn moments_a_rounding_apart_stop_nobody() {
    let apart = 0.1 + 0.2;
    assert!(apart != 0.3);
    let held = "[effects.contact]\n[effects.hold]\n[effects.gait]\n[effects.noise]\n";
    for text in [
        format!("{held}[effects.path]\nturn_deg = 10.0\nturn_start_s = 0.1\nturn_time_s = 0.2"),
        format!("{held}[effects.music]\nonset_s = {apart:?}"),
        format!("{held}[effects.lift]\nonset_s = {apart:?}\nbuild_up_s = 0.1"),
        format!(
            "{held}[effects.music]\nonset_s = 0.0\ntempo_changes = [{{ at_s = 0.1, over_s = 0.2, beat_hz = 2.0 }}]"
        ),
    ] {
        for method in METHODS.iter().map(|m| m.name) {
            let mut s = scene(&format!("name = \"apart\"\nduration_s = 1.0\n{text}"));
            s.solver.method = method.into();
            let all = samples(&s);
            assert_eq!(all.last().unwrap().t_s, 1.0, "{method} {text}");
        }
    }
}

/// From 8,192 s on two doubles are further apart than what counts as one moment before: noise, samples and events still meet.
#[test]
fn hours_of_music_end() {
    let set = ["duration_s=8200", "solver.energy=false"].map(String::from);
    let scene = parse("music", builtin("music").unwrap(), &set).unwrap();
    let settings = Settings {
        tolerance: 1e-6,
        step_s: f64::NAN,
        most_evaluations: 40_000_000,
    };
    for name in ["radau15", "dop853"] {
        let mut times = Vec::new();
        let (_, outcome) = run_model(
            &Model::new(&scene),
            method(name).unwrap(),
            &settings,
            &mut |s: &Sample| {
                times.push(s.t_s);
                true
            },
        );
        outcome.unwrap_or_else(|e| panic!("{name}: {e}"));
        let tick = |(k, t): (usize, &f64)| *t == k as f64 / 30.0;
        assert_eq!(times.len(), 246_001, "{name}");
        assert!(times.iter().enumerate().all(tick), "{name}");
    }
}

/// Every moment at which a law jumps or bends, and no other, ends a step: without it a method would have to find out.
#[test]
fn a_step_ends_wherever_a_law_jumps_or_bends() {
    let scene = scene(
        r#"
        name = "turns"
        duration_s = 60.0
        [effects.contact]
        [effects.sling]
        [effects.gait]
        [effects.lift]
        onset_s = 7.0
        build_up_s = 4.0
        [effects.path]
        turn_deg = 90.0
        turn_start_s = 11.0
        turn_time_s = 2.5
        [effects.music]
        onset_s = 5.0
        build_up_s = 4.0
        tempo_changes = [{ at_s = 20.0, over_s = 1.5, beat_hz = 2.5 }, { at_s = 30.0, beat_hz = 2.0 }]
        pauses = [{ from_s = 40.0, to_s = 42.0 }]
        "#,
    );
    let model = Model::new(&scene);
    let next = |after: &f64| Some(model.next_switch_s(*after)).filter(|t| t.is_finite());
    let found: Vec<f64> = std::iter::successors(next(&0.0), next).collect();
    let expected = [5.0, 7.0, 11.0, 13.5, 20.0, 21.5, 30.0, 40.0, 42.0];
    assert_eq!(found, expected);
}
