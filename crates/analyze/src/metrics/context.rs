//! What the metrics of one window share: the columns cut to the window and freed of non-finite samples, and what is dear to compute.

use std::borrow::Cow;
use std::cell::OnceCell;

use crate::beat::adler::Adler;
use crate::inputs::{Inputs, Window, mean_step_s};
use crate::line::{Line, NEAR};

/// A column that a metric cannot do without.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Need {
    /// Rotation about the pole.
    Roll,
    /// The same, often enough for a beat that sounds.
    RollLine,
    /// Tilt of the pole.
    Pitch,
    /// Heading.
    Yaw,
    /// Height of the centre of mass.
    Height,
    /// The same, often enough for a beat that sounds.
    HeightLine,
    /// Normal forces of the handles.
    Forces,
    /// Normal forces, or the support ratio measured as such.
    Support,
    /// Phases of the carriers.
    Phases,
    /// Phase of the beat.
    Beat,
    /// All carriers' phases at a time at which a beat sounds.
    PhasesInBeat,
    /// Steps of the carriers.
    Steps,
}

/// One column in the window, finite.
pub struct Series<'a> {
    /// Times (s).
    pub t_s: Cow<'a, [f64]>,
    /// Values.
    pub x: Cow<'a, [f64]>,
}

/// Several columns on one time axis in the window; samples at which any is not finite are left out of all.
pub struct Table<'a> {
    /// Times (s).
    pub t_s: Cow<'a, [f64]>,
    /// Columns.
    pub columns: Vec<Cow<'a, [f64]>>,
}

impl<'a> Table<'a> {
    /// The window's part of `columns`; an empty table where there are none or their lengths differ.
    fn cut(t_s: &'a [f64], columns: &[&'a [f64]], window: Window) -> Self {
        if columns.is_empty() || columns.iter().any(|c| c.len() != t_s.len()) {
            return Table {
                t_s: Cow::Borrowed(&[]),
                columns: Vec::new(),
            };
        }
        let range = window.range(t_s);
        let (t_s, columns): (&[f64], Vec<&[f64]>) = (
            &t_s[range.clone()],
            columns.iter().map(|c| &c[range.clone()]).collect(),
        );
        if columns.iter().all(|c| c.iter().all(|x| x.is_finite())) {
            return Table {
                t_s: Cow::Borrowed(t_s),
                columns: columns.into_iter().map(Cow::Borrowed).collect(),
            };
        }
        let whole: Vec<usize> = (0..t_s.len())
            .filter(|k| columns.iter().all(|c| c[*k].is_finite()))
            .collect();
        let pick = |c: &[f64]| Cow::Owned(whole.iter().map(|k| c[*k]).collect());
        Table {
            t_s: pick(t_s),
            columns: columns.into_iter().map(pick).collect(),
        }
    }

    /// Number of samples.
    pub fn len(&self) -> usize {
        self.t_s.len()
    }

    /// Whether there is no sample.
    pub fn is_empty(&self) -> bool {
        self.t_s.is_empty()
    }

    /// The columns as slices.
    pub fn slices(&self) -> Vec<&[f64]> {
        self.columns.iter().map(|c| &c[..]).collect()
    }
}

/// What the metrics of one window are computed from.
pub struct Context<'a> {
    /// The columns as they were given.
    pub inputs: &'a Inputs,
    /// The window.
    pub window: Window,
    roll: OnceCell<Series<'a>>,
    height: OnceCell<Series<'a>>,
    forces: OnceCell<Table<'a>>,
    phases: OnceCell<Table<'a>>,
    height_line: OnceCell<Option<Line>>,
    aliased: OnceCell<Option<String>>,
    onset: OnceCell<Option<f64>>,
    adler: OnceCell<Result<Adler, &'static str>>,
}

/// A mean support below this share of its root mean square is none. On shoulders that leave the load alone half the time it is 0.7.
const LEAST_SUPPORT: f64 = 0.1;

impl<'a> Context<'a> {
    /// Nothing is computed yet.
    pub fn new(inputs: &'a Inputs, window: Window) -> Self {
        Context {
            inputs,
            window,
            roll: OnceCell::new(),
            height: OnceCell::new(),
            forces: OnceCell::new(),
            phases: OnceCell::new(),
            height_line: OnceCell::new(),
            aliased: OnceCell::new(),
            onset: OnceCell::new(),
            adler: OnceCell::new(),
        }
    }

    fn series(&self, x: &'a [f64]) -> Series<'a> {
        self.series_on(&self.inputs.t_s, x)
    }

    fn series_on(&self, t_s: &'a [f64], x: &'a [f64]) -> Series<'a> {
        let mut table = Table::cut(t_s, &[x], self.window);
        Series {
            t_s: table.t_s,
            x: table.columns.pop().unwrap_or(Cow::Borrowed(&[])),
        }
    }

    /// The roll (rad).
    pub fn roll(&self) -> &Series<'a> {
        self.roll.get_or_init(|| self.series(&self.inputs.roll_rad))
    }

    /// The pitch (rad).
    pub fn pitch(&self) -> Series<'a> {
        self.series(&self.inputs.pitch_rad)
    }

    /// The yaw (rad).
    pub fn yaw(&self) -> Series<'a> {
        self.series(&self.inputs.yaw_rad)
    }

    /// The height (m).
    pub fn height(&self) -> &Series<'a> {
        self.height.get_or_init(|| {
            let (t_s, x) = self.inputs.height();
            self.series_on(t_s, x)
        })
    }

    /// The ratio N_tot / (M g) where it was measured as such.
    pub fn support_ratio(&self) -> Series<'a> {
        self.series(&self.inputs.support_ratio)
    }

    /// The handles' normal forces (N).
    pub fn forces(&self) -> &Table<'a> {
        self.forces.get_or_init(|| {
            let columns: Vec<&[f64]> = self.inputs.normal_n.iter().map(|c| &c[..]).collect();
            Table::cut(self.inputs.force_times(), &columns, self.window)
        })
    }

    /// The sum of the handles' normal forces (N).
    pub fn total_force_n(&self) -> Vec<f64> {
        let forces = self.forces();
        (0..forces.len())
            .map(|k| forces.columns.iter().map(|n| n[k]).sum())
            .collect()
    }

    /// M·g (N). Where no mass is known the mean support over the window: over many strides what is carried neither rises nor falls.
    ///
    /// # Errors
    /// As [`Self::upright`]; without a mass also forces whose mean is next to nothing beside them.
    pub fn weight_n(&self) -> Result<f64, String> {
        let (mean_n, rms_n) = self.upright()?;
        match self.inputs.mass_kg {
            Some(mass_kg) => Ok(mass_kg * self.inputs.gravity_m_per_s2),
            None => {
                let tells = mean_n > LEAST_SUPPORT * rms_n;
                tells.then_some(mean_n).ok_or_else(|| format!(
                    "the mean support is {mean_n:.1} N, which is no load's weight: does it stand on another axis of the sensor? mass_kg in a roles file, or forces = [\"TOPIC.FIELD\", …], says it"
                ))
            }
        }
    }

    /// Mean and root mean square of the support, N, whose mean pushes what is carried up.
    ///
    /// # Errors
    /// A mean support that is negative: a sentence.
    pub fn upright(&self) -> Result<(f64, f64), String> {
        let total = self.total_force_n();
        let squares: Vec<f64> = total.iter().map(|n| n * n).collect();
        let mean = super::contact::mean;
        let (mean_n, rms_n) = (mean(&total), mean(&squares).sqrt());
        match mean_n < -LEAST_SUPPORT * rms_n {
            true => Err(format!(
                "the mean support is {mean_n:.0} N, as if the load hung from the sky: these are forces on the carriers, or of a sensor that counts down; they are wanted with the other sign"
            )),
            false => Ok((mean_n, rms_n)),
        }
    }

    /// The carriers' phases (rad).
    pub fn phases(&self) -> &Table<'a> {
        self.phases.get_or_init(|| {
            let columns: Vec<&[f64]> = self.inputs.phase_rad.iter().map(|c| &c[..]).collect();
            Table::cut(self.inputs.phase_times(), &columns, self.window)
        })
    }

    /// The beat's phase (rad), first column, then the carriers' phases: the samples at which a beat sounds.
    pub fn beat(&self) -> Table<'a> {
        let mut columns: Vec<&[f64]> = vec![&self.inputs.beat_phase_rad];
        columns.extend(self.inputs.phase_rad.iter().map(|c| &c[..]));
        Table::cut(self.inputs.phase_times(), &columns, self.window)
    }

    /// The beat's phase (rad) wherever it sounds.
    pub fn beat_alone(&self) -> Series<'a> {
        self.series_on(self.inputs.phase_times(), &self.inputs.beat_phase_rad)
    }

    /// The strongest line of the height.
    pub fn height_line(&self) -> Option<&Line> {
        self.height_line
            .get_or_init(|| Line::strongest(&self.height().t_s, &self.height().x))
            .as_ref()
    }

    /// Why the height's line is none, where a beat sounds that is faster than the height's samples can show: what they show instead is an alias.
    pub fn aliased(&self) -> Option<String> {
        let height = || self.hides_the_beat("height", self.height());
        self.aliased.get_or_init(height).clone()
    }

    fn hides_the_beat(&self, what: &str, column: &Series<'_>) -> Option<String> {
        self.missing(Need::Beat).is_none().then_some(())?;
        let beat_hz = super::together::beat_hz(self).as_f64()?;
        let half_rate_hz = 0.5 / column.step_s()?;
        (beat_hz > half_rate_hz).then(|| format!(
            "the {what} has {:.2} samples per second, too few for a motion at the beat's {beat_hz:.2} Hz: more than {:.2} are needed",
            2.0 * half_rate_hz,
            2.0 * beat_hz
        ))
    }

    /// Why the roll cannot be held against the height's line, where it is sampled too slowly to show that.
    pub fn too_slow(&self) -> Option<String> {
        let hz = self.height_line()?.hz;
        let half_rate_hz = 0.5 / self.roll().step_s()?;
        ((1.0 + NEAR) * hz > half_rate_hz).then(|| format!(
            "the height's line, {hz:.2} Hz, cannot be seen in the roll, which has {:.2} samples per second: more than {:.2} are needed",
            2.0 * half_rate_hz,
            2.0 * (1.0 + NEAR) * hz
        ))
    }

    /// The end of the first unstable stretch (s).
    pub fn onset(&self) -> Option<f64> {
        *self
            .onset
            .get_or_init(|| super::onset_s(&self.roll().t_s, &self.roll().x))
    }

    /// Adler's test, on all phases about the first beat, whatever the window.
    pub fn adler(&self) -> &Result<Adler, &'static str> {
        self.adler.get_or_init(|| Adler::of(self.inputs))
    }

    /// Why a column is missing, or `None` when it is there.
    pub fn missing(&self, need: Need) -> Option<String> {
        let empty = |kept: bool, what: &str| match (self.has(need), kept) {
            (false, _) => Some(format!("no {what} in the recording")),
            (true, false) => Some(format!("no finite sample of {what} in the window")),
            (true, true) => None,
        };
        match need {
            Need::Roll => empty(!self.roll().x.is_empty(), "roll"),
            Need::RollLine => self
                .missing(Need::Roll)
                .or_else(|| self.hides_the_beat("roll", self.roll())),
            Need::Pitch => empty(!self.pitch().x.is_empty(), "pitch"),
            Need::Yaw => empty(!self.yaw().x.is_empty(), "yaw"),
            Need::Height => empty(!self.height().x.is_empty(), "height"),
            Need::HeightLine => self.missing(Need::Height).or_else(|| self.aliased()),
            Need::Forces => empty(!self.forces().is_empty(), "handle forces"),
            Need::Support if self.inputs.normal_n.is_empty() => empty(
                !self.support_ratio().x.is_empty(),
                "handle forces or support",
            ),
            Need::Support => empty(!self.forces().is_empty(), "handle forces"),
            Need::Phases => empty(!self.phases().is_empty(), "carriers' phases"),
            Need::Beat => empty(!self.beat_alone().x.is_empty(), "beat"),
            Need::PhasesInBeat => empty(
                !self.beat().is_empty(),
                "all carriers' phases while a beat sounds",
            ),
            Need::Steps => empty(true, "carrier's steps"),
        }
    }

    /// Whether the recording has a column at all.
    fn has(&self, need: Need) -> bool {
        let i = self.inputs;
        match need {
            Need::Roll | Need::RollLine => !i.roll_rad.is_empty(),
            Need::Pitch => !i.pitch_rad.is_empty(),
            Need::Yaw => !i.yaw_rad.is_empty(),
            Need::Height | Need::HeightLine => !i.height().1.is_empty(),
            Need::Forces => !i.normal_n.is_empty(),
            Need::Support => !i.normal_n.is_empty() || !i.support_ratio.is_empty(),
            Need::Phases => !i.phase_rad.is_empty(),
            Need::PhasesInBeat => self.has(Need::Phases) && self.has(Need::Beat),
            Need::Beat => i.beat_phase_rad.iter().any(|p| p.is_finite()),
            Need::Steps => !i.step_s.is_empty(),
        }
    }

    /// The word for where a column comes from; empty where there is none.
    pub fn source(&self, need: Need) -> String {
        if !self.has(need) {
            return String::new();
        }
        let s = &self.inputs.sources;
        match need {
            Need::Roll | Need::RollLine | Need::Pitch | Need::Yaw => &s.attitude,
            Need::Height | Need::HeightLine => &s.height,
            Need::Forces | Need::Support => &s.forces,
            Need::Phases | Need::PhasesInBeat => &s.phases,
            Need::Beat => &s.beat,
            Need::Steps => "imu",
        }
        .to_string()
    }
}

impl Series<'_> {
    /// Mean sampling step (s).
    pub fn step_s(&self) -> Option<f64> {
        mean_step_s(&self.t_s)
    }
}
