//! Parameters of the model from a recording, with intervals.
//!
//! ```text
//! beat, pull     φ̇_i = ω_i + K m(t) sin(Ωt + ψ₀ − φ_i) + noise,   m(t) = 1 − e^{−(t − t₀)/τ} from t₀ on
//! coupling       … + (K_c/N) Σ_j sin(φ_j − φ_i)                     where it shows
//! amplitude      z_i = A_i sin φ_i + B_i cos φ_i                      √(A² + B²), lift and all
//! contact        N_i = k δ_i + c δ̇_i                               in contact, away from where any opens or closes
//! … from sensors N_tot = k Σδ_i + c Σδ̇_i + e                       while all handles carry
//! pendulum       θ̈ = −a N_tot sin θ − b θ̇                          a = h/(I_xx + M h²) where the handles are held
//! ```
//! φ_i gait phases (rad), Ω = 2π·beat, ω_i own frequencies [rad/s], K pull of the music [rad/s]; t₀, τ its onset and build-up (s),
//! taken from a scene. Where the beat's phase was recorded it takes the place of Ωt + ψ₀. Increments of φ carry white noise, so least squares (Gauss and Newton) gives the interval of Ω, K, ω_i
//! by itself; sines are the mean of both ends of an increment, the end as expected from its beginning (a predictor: the observed one would
//! hold the increment's own noise), an error of (ω_i − Ω)²Δt²/12 of K, which the interval holds, with half of what K and ω_i change by when
//! every other sample is left out, and all of what they change by when a coupling K_c is allowed for that does not show by itself (six standard
//! errors). Where neighbouring increments share noise, because it was drawn on a coarser clock than the recorder's, samples are left
//! out until less than a fifth is shared, up to steps of 0.1 s, and what is shared is counted: σ² Δt = Σ e_k² + 2 Σ e_k e_{k+1}. What the pull
//! and the others take back of the noise within an increment, at the rate λ = K m cos(Ωt + ψ₀ − φ) + (K_c/N) Σ_{j≠i} cos(φ_j − φ_i), is put back: white noise is left with a
//! share (1 − e^(−2λΔt))/(2λΔt) of its variance, noise that is even over Δt with the square of (1 − e^(−λΔt))/(λΔt), and the interval holds both, and what a coupling that does
//! not show would take back. Where what is missed is not as strong
//! over a second as white noise would be (stronger by half and five standard errors, or weaker by three), or a tenth of it and more comes back with a carrier's own steps, carriers do what the model does not know, and
//! nothing is told. On a graph, the scene's, the coupling is K_c/(d_i + 1) times the sum over the d_i neighbours.
//! Nothing reaches across a hole of the record: no increment, no spline, no straight line through a beat.
//! k, c where compression was recorded: linear least squares on means over three samples and Lele's slope that goes with them, errors of (ωΔt)⁶/2100; a, b: the
//! equation under windows of four roll periods that vanish with their derivatives at both ends, so that no rate of the roll is taken. Their intervals are a jackknife's over
//! blocks of 2 s, all handles together, and of one such window, because neighbours are alike, with Student's t, because contact may be kept in a few of them only;
//! three sixty-thirds count of what leaving out every other sample changes, three times the error of a rule of the sixth order (Roache 1994).
//! δ̇ from sensors is the not-a-knot spline's; k, c have intervals from a moving-block bootstrap (500 draws, the same blocks) then.
//! Where steps tell the phases, pull and gait are those of Adler's test
//! ([`analyze::beat::adler`]), which knows that a step detector smooths them and finds τ by itself. Contact from sensors adds what it changes by when every other
//! sample is left out: a bound, 15 times over, of what the sampling does. From sensors z_i is the shoulder's and the body's motion about
//! their slow course, δ_i = z_i − (body's height + (R p_i)_z), N_tot the body's specific force times its mass; a handle carries where
//! k δ_i + c δ̇_i + e/N, its share of the load, is above a seventh of the weight over N. The intervals of k and c reach to what they would be if all
//! that is missed were an error of δ, or of δ̇, and not of the force (Frisch 1934); one that is wider than its value tells none. Source: Seber & Wild, Nonlinear Regression (1989);
//! Künsch, Ann. Stat. 17 (1989); Lele, J. Comput. Phys. 103 (1992) 16; Shinbrot, Trans. ASME 79 (1957) 547; docs/reproduction.md.

mod contact;
mod gait;
mod read;
mod squares;

use analyze::inputs::{Inputs, Window, mean_step_s, stretches};
use contact::{contact, contact_from_sensors, pendulum};
use gait::{amplitudes, gait};
use std::ops::Range;

/// What a fit is made from.
#[derive(Clone, Debug, Default)]
pub struct Field {
    /// Columns of the recording.
    pub inputs: Inputs,
    /// Compression of each handle's spring (m), on the forces' time; empty where nobody measured it.
    pub compression_m: Vec<Vec<f64>>,
    /// Handles in the body's axes, m: what compression from inertial sensors needs.
    pub handles_m: Vec<[f64; 3]>,
    /// Pairs of carriers (from 0) that mind each other; `None` where everybody minds everybody.
    pub pairs: Option<Vec<[usize; 2]>>,
    /// When the music begins, s.
    pub onset_s: f64,
    /// How long it builds up, s.
    pub build_up_s: f64,
    /// What is known of the sensors' clocks.
    pub clocks: Clocks,
    /// Beats per second as they were heard, and half of the 95 % interval, Hz, where single beats tell it.
    pub heard_hz: Option<(f64, f64)>,
}

/// Why parameters that rest on several clocks have no value, where they have none.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Clocks {
    /// Of the rath's clock beside the carriers': stiffness and damping.
    pub no_contact: Option<&'static str>,
    /// Of the carriers' clocks beside each other and the beat's: pull, coupling and gait.
    pub no_pull: Option<&'static str>,
}

impl Clocks {
    fn spoil(&self, name: &str) -> Option<&'static str> {
        match name {
            "stiffness" | "damping" => self.no_contact,
            "pull" | "coupling" => self.no_pull,
            _ if name.starts_with("gait") => self.no_pull,
            _ => None,
        }
    }
}

/// A parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct Estimate {
    /// Name.
    pub name: String,
    /// Unit.
    pub unit: &'static str,
    /// The estimate.
    pub value: f64,
    /// Ends of its 95 % interval.
    pub interval: [f64; 2],
}

/// A parameter, or what it is called and why there is none.
pub type Outcome = Result<Estimate, (String, String)>;

/// Bootstrap samples behind an interval.
const DRAWS: u64 = 500;
/// Length of a block, s: two periods of the roll and a little.
const BLOCK_S: f64 = 2.0;
/// A handle carries where its share of the load is above this part of the mean share.
const CARRIES: f64 = 1.0 / 7.0;
/// Samples left out at each end of a stretch, where the spline's derivative is poor.
const EDGE: usize = 4;

/// Everything that the recording can tell. Pendulum, amplitudes and contact from sensors over `window`, the rest over all of it.
pub fn fit(field: &Field, window: Window) -> Vec<Outcome> {
    let missing = |names: &[&str], why: String| -> Vec<Outcome> {
        names
            .iter()
            .map(|n| Err(((*n).to_owned(), why.clone())))
            .collect()
    };
    let mut out = gait(field).unwrap_or_else(|why| missing(&["beat", "pull"], why));
    out.extend(amplitudes(field, window).unwrap_or_else(|why| missing(&["amplitude"], why)));
    let contact = match field.inputs.heave_m.is_empty() {
        true => contact(field),
        false => contact_from_sensors(field, window),
    };
    out.extend(contact.unwrap_or_else(|why| missing(&["stiffness", "damping"], why)));
    out.extend(
        pendulum(field, window).unwrap_or_else(|why| missing(&["pendulum", "roll damping"], why)),
    );
    // No interval knows of a clock that is wrong.
    for outcome in &mut out {
        let (Ok(Estimate { name, .. }) | Err((name, _))) = &*outcome;
        if let Some(why) = field.clocks.spoil(name) {
            *outcome = Err((name.clone(), why.to_owned()));
        }
    }
    out
}

/// Where nothing is recorded, a sentence for each time axis that has holes: no increment and no derivative reaches across one.
pub fn holes(field: &Field) -> Vec<String> {
    let i = &field.inputs;
    let axes = [
        ("the body's motion", &i.t_s[..]),
        ("the forces", i.force_times()),
        ("the phases", i.phase_times()),
    ];
    let mut told: Vec<(Vec<&str>, String)> = Vec::new();
    for (name, t_s) in axes {
        let parts = stretches(t_s, 0.0);
        let lost = parts
            .windows(2)
            .map(|w| (t_s[w[0].end - 1], t_s[w[1].start]));
        let lost: Vec<String> = lost.map(|(a, b)| format!("{a:.2} to {b:.2} s")).collect();
        let where_ = match &lost[..] {
            [] => continue,
            all if all.len() <= 3 => all.join(", "),
            [first, rest @ ..] => format!("{first} and {} more times", rest.len()),
        };
        match told.iter_mut().find(|(_, other)| *other == where_) {
            Some((names, _)) => names.push(name),
            None => told.push((vec![name], where_)),
        }
    }
    let sentence = |(names, where_): (Vec<&str>, String)| {
        format!(
            "nothing of {} is recorded from {where_}; nothing is fitted across that",
            names.join(", ")
        )
    };
    told.into_iter().map(sentence).collect()
}

/// The parts of an axis that are evenly sampled, for splines: a single sample that is missing ends one too.
fn even(t_s: &[f64]) -> Vec<Range<usize>> {
    let Some(step_s) = mean_step_s(t_s) else {
        return Vec::new();
    };
    let mut parts = Vec::new();
    let mut start = 0;
    for end in 1..=t_s.len() {
        if end == t_s.len() || t_s[end] - t_s[end - 1] > 1.5 * step_s {
            parts.push(start..end);
            start = end;
        }
    }
    parts
}

fn estimate(name: impl Into<String>, unit: &'static str, value: f64, half: f64) -> Outcome {
    Ok(Estimate {
        name: name.into(),
        unit,
        value,
        interval: [value - half, value + half],
    })
}

/// An interval with what sensor and method leave uncertain by themselves, a relative standard deviation, which no redrawing of one
/// recording's blocks can show.
fn budgeted(value: f64, [low, high]: [f64; 2], scale: f64) -> [f64; 2] {
    let own = 1.96 * scale * value;
    [
        value - (value - low).hypot(own),
        value + (high - value).hypot(own),
    ]
}

/// Two parameters.
fn pair(
    names: [(&str, &'static str); 2],
    value: [f64; 2],
    interval: [[f64; 2]; 2],
) -> Vec<Outcome> {
    (0..2)
        .map(|p| {
            Ok(Estimate {
                name: names[p].0.into(),
                unit: names[p].1,
                value: value[p],
                interval: interval[p],
            })
        })
        .collect()
}

#[test]
fn what_rests_on_several_clocks_has_none_where_they_differ() {
    let clocks = Clocks {
        no_pull: Some("apart"),
        ..Clocks::default()
    };
    for name in ["pull", "coupling", "gait 1"] {
        assert_eq!(clocks.spoil(name), Some("apart"), "{name}");
    }
    assert_eq!(clocks.spoil("beat"), None);
}
