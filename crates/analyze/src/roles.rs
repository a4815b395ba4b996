//! Which signal is what: named by the user, inferred from schemas otherwise, printed always.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use recording::text::document::from_toml;
use serde::Deserialize;

/// The columns that metrics are computed from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Role {
    /// Height of the centre of mass (m).
    Height,
    /// Rotation about the pole (rad).
    Roll,
    /// Tilt of the pole (rad).
    Pitch,
    /// Heading (rad).
    Yaw,
    /// Normal force of one handle (N); as many as there are handles.
    Forces,
    /// Gait phase of one carrier (rad); as many as there are carriers.
    Phases,
    /// Phase of the beat (rad).
    BeatPhase,
    /// Topic of the IMU on what is carried; further ones there follow it.
    Imu,
    /// Topic of the IMU of one carrier.
    Carriers,
    /// Topic with one message per beat.
    Beats,
    /// Topic of a true pose, for judging estimates.
    Truth,
}

impl Role {
    /// All roles, in the order in which they are printed.
    pub const ALL: [Role; 11] = [
        Role::Height,
        Role::Roll,
        Role::Pitch,
        Role::Yaw,
        Role::Forces,
        Role::Phases,
        Role::BeatPhase,
        Role::Imu,
        Role::Carriers,
        Role::Beats,
        Role::Truth,
    ];

    /// Its name in a roles file and in JSON.
    pub fn name(self) -> &'static str {
        match self {
            Role::Height => "height",
            Role::Roll => "roll",
            Role::Pitch => "pitch",
            Role::Yaw => "yaw",
            Role::Forces => "forces",
            Role::Phases => "phases",
            Role::BeatPhase => "beat_phase",
            Role::Imu => "imu",
            Role::Carriers => "carriers",
            Role::Beats => "beats",
            Role::Truth => "truth",
        }
    }

    /// Whether one signal alone plays the role.
    pub fn is_single(self) -> bool {
        !self.is_topic() && !matches!(self, Role::Forces | Role::Phases)
    }

    /// Whether what plays it is an angle.
    pub fn is_angle(self) -> bool {
        matches!(
            self,
            Role::Roll | Role::Pitch | Role::Yaw | Role::Phases | Role::BeatPhase
        )
    }

    /// Whether the role is played by whole topics, not by single signals.
    pub fn is_topic(self) -> bool {
        matches!(self, Role::Imu | Role::Carriers | Role::Beats | Role::Truth)
    }
}

/// What a `--roles` file may say: `height = "/odom.pose.pose.position.z"`, `forces = ["/left.wrench.force.z", ...]`, ...
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RolesFile {
    height: Option<String>,
    roll: Option<String>,
    pitch: Option<String>,
    yaw: Option<String>,
    #[serde(default, deserialize_with = "one_or_more")]
    forces: Vec<String>,
    #[serde(default, deserialize_with = "one_or_more")]
    phases: Vec<String>,
    beat_phase: Option<String>,
    /// The first is what motion is estimated from; others on the load are held against it.
    #[serde(default, deserialize_with = "one_or_more")]
    imu: Vec<String>,
    #[serde(default, deserialize_with = "one_or_more")]
    carriers: Vec<String>,
    beats: Option<String>,
    truth: Option<String>,
    /// Unit of angles whose field does not tell its own by a suffix; radians where nobody says.
    pub angle_unit: Option<AngleUnit>,
    /// Mass of what is carried (kg); stands over the recording's own.
    #[serde(default, deserialize_with = "above_zero")]
    pub mass_kg: Option<f64>,
    /// Gravity [m/s²]; stands over the recording's own.
    #[serde(default, deserialize_with = "above_zero")]
    pub gravity_m_per_s2: Option<f64>,
    /// Start of the analysis window (s), where `--window` does not say.
    #[serde(default, deserialize_with = "not_negative")]
    pub analysis_start_s: Option<f64>,
    /// The load's sensor: its place from the centre of mass, forward, left, up (m).
    #[serde(default, deserialize_with = "lever")]
    pub imu_place_m: Option<[f64; 3]>,
    /// How its axes stand to those of the load: roll, pitch, yaw, R = R_z R_y R_x (deg). Without it they are levelled by gravity.
    #[serde(default, deserialize_with = "angles")]
    pub imu_mounting_roll_pitch_yaw_deg: Option<[f64; 3]>,
    /// How old a gyroscope's sample is at its stamp (s).
    #[serde(default, deserialize_with = "age")]
    pub gyro_age_s: Option<f64>,
    /// How old an accelerometer's sample is at its stamp (s).
    #[serde(default, deserialize_with = "age")]
    pub accel_age_s: Option<f64>,
    /// Standard deviation of what is constantly wrong with an accelerometer's axis (m/s²).
    #[serde(default, deserialize_with = "not_negative")]
    pub accel_bias_m_per_s2: Option<f64>,
    /// Standard deviation of the scale error of a gyroscope's axis (relative).
    #[serde(default, deserialize_with = "not_negative")]
    pub gyro_scale_error: Option<f64>,
    /// Standard deviation of how far the axes of the load's sensor stand otherwise on it (degrees).
    #[serde(default, deserialize_with = "not_negative")]
    pub imu_mounting_error_deg: Option<f64>,
}

/// Unit of an angle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum AngleUnit {
    /// Radians.
    Rad,
    /// Degrees.
    Deg,
}

/// One name, or a list of them.
fn one_or_more<'de, D: serde::Deserializer<'de>>(from: D) -> Result<Vec<String>, D::Error> {
    #[derive(Deserialize)]
    #[serde(untagged, expecting = "expected a name or a list of names")]
    enum Names {
        One(String),
        More(Vec<String>),
    }
    Ok(match Names::deserialize(from)? {
        Names::One(name) => vec![name],
        Names::More(names) => names,
    })
}

/// What a mass and gravity can be.
fn above_zero<'de, D: serde::Deserializer<'de>>(from: D) -> Result<Option<f64>, D::Error> {
    number(from, f64::MIN_POSITIVE, "a number above zero")
}

fn not_negative<'de, D: serde::Deserializer<'de>>(from: D) -> Result<Option<f64>, D::Error> {
    number(from, 0.0, "zero or more")
}

fn number<'de, D: serde::Deserializer<'de>>(
    from: D,
    least: f64,
    expected: &str,
) -> Result<Option<f64>, D::Error> {
    let x = f64::deserialize(from)?;
    if !(least..=1e18).contains(&x) {
        return Err(serde::de::Error::custom(format!(
            "found {x:e}, expected {expected}"
        )));
    }
    Ok(Some(x))
}

/// An age that a sensor's sample can have.
fn age<'de, D: serde::Deserializer<'de>>(from: D) -> Result<Option<f64>, D::Error> {
    let age_s = f64::deserialize(from)?;
    if !(-0.2..=0.2).contains(&age_s) {
        return Err(serde::de::Error::custom(format!(
            "found an age of {age_s} s, expected -0.2 to 0.2"
        )));
    }
    Ok(Some(age_s))
}

/// Metres from the centre of mass; no pole is longer, and centimetres are more.
fn lever<'de, D: serde::Deserializer<'de>>(from: D) -> Result<Option<[f64; 3]>, D::Error> {
    three(from, 10.0, "metres, up to 10")
}

fn angles<'de, D: serde::Deserializer<'de>>(from: D) -> Result<Option<[f64; 3]>, D::Error> {
    three(from, 1e3, "degrees, up to 1000")
}

fn three<'de, D: serde::Deserializer<'de>>(
    from: D,
    most: f64,
    expected: &str,
) -> Result<Option<[f64; 3]>, D::Error> {
    let values = <[f64; 3]>::deserialize(from)?;
    if !values.iter().all(|x| x.abs() <= most) {
        return Err(serde::de::Error::custom(format!(
            "found {values:?}, expected three numbers in {expected}"
        )));
    }
    Ok(Some(values))
}

impl RolesFile {
    /// Reads one.
    ///
    /// # Errors
    /// A sentence where it cannot be read or says what is none.
    pub fn read(path: &Path) -> Result<Self, String> {
        let name = path.display();
        let text = recording::text::read_text(path)
            .map_err(|why| format!("{name}: the roles cannot be read: {why}"))?;
        from_toml(&text).map_err(|wrong| {
            let (place, message) = (wrong.place(name), wrong.message);
            format!("{place}: is not a roles file: {message}")
        })
    }

    /// All signals that it names.
    pub fn signals(&self) -> Vec<String> {
        let roles = Role::ALL.iter().filter(|role| !role.is_topic());
        roles.flat_map(|role| self.patterns(*role)).collect()
    }

    /// What it says of a role: paths of signals, or topics.
    pub fn patterns(&self, role: Role) -> Vec<String> {
        match role {
            Role::Height => self.height.iter().cloned().collect(),
            Role::Roll => self.roll.iter().cloned().collect(),
            Role::Pitch => self.pitch.iter().cloned().collect(),
            Role::Yaw => self.yaw.iter().cloned().collect(),
            Role::Forces => self.forces.clone(),
            Role::Phases => self.phases.clone(),
            Role::BeatPhase => self.beat_phase.iter().cloned().collect(),
            Role::Imu => self.imu.clone(),
            Role::Carriers => self.carriers.clone(),
            Role::Beats => self.beats.iter().cloned().collect(),
            Role::Truth => self.truth.iter().cloned().collect(),
        }
    }
}

/// Schema of a sound.
pub(crate) const SOUND: &str = "foxglove.RawAudio";

/// How a message type plays roles when nobody says otherwise: (schema, role, field pattern).
const BY_SCHEMA: &[(&str, Role, &str)] = &[
    ("rath.State", Role::Height, "position_m.z"),
    ("rath.State", Role::Roll, "roll_rad"),
    ("rath.State", Role::Pitch, "pitch_rad"),
    ("rath.State", Role::Yaw, "yaw_rad"),
    ("rath.HandleForces", Role::Forces, "normal_n[*]"),
    ("rath.Phases", Role::Phases, "phase_rad[*]"),
    ("rath.Phases", Role::BeatPhase, "beat_phase_rad"),
    (
        "geometry_msgs/WrenchStamped",
        Role::Forces,
        "wrench.force.z",
    ),
];

/// Where message types hold a pose: (schema, place, orientation), in order of preference.
const POSES: &[(&str, &str, &str)] = &[
    (
        "nav_msgs/Odometry",
        "pose.pose.position",
        "pose.pose.orientation",
    ),
    (
        "geometry_msgs/PoseStamped",
        "pose.position",
        "pose.orientation",
    ),
    (
        "geometry_msgs/PoseWithCovarianceStamped",
        "pose.pose.position",
        "pose.pose.orientation",
    ),
    (
        "geometry_msgs/TransformStamped",
        "transform.translation",
        "transform.rotation",
    ),
    ("foxglove.PoseInFrame", "pose.position", "pose.orientation"),
    ("foxglove.Odometry", "pose.position", "pose.orientation"),
];

/// All rows of schema, role and field.
fn by_schema() -> impl Iterator<Item = (&'static str, Role, String)> {
    let own = BY_SCHEMA
        .iter()
        .map(|(s, role, f)| (*s, *role, (*f).to_owned()));
    let poses = POSES.iter().flat_map(|(schema, place, turn)| {
        [
            (*schema, Role::Height, format!("{place}.z")),
            (*schema, Role::Roll, format!("{turn}.roll")),
            (*schema, Role::Pitch, format!("{turn}.pitch")),
            (*schema, Role::Yaw, format!("{turn}.yaw")),
        ]
    });
    own.chain(poses)
}

/// Which signals and topics play which role.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Roles {
    patterns: BTreeMap<Role, Vec<String>>,
    /// Roles that the user gave.
    said: BTreeSet<Role>,
    /// What the user says of the sensors themselves.
    pub sensors: Sensors,
    /// Topics that were taken out of several that could have been, with a sentence each.
    pub chosen: Vec<(String, String)>,
    /// Of inertial topics that are by name half a device, gyroscope or accelerometer: the other half.
    halves: BTreeMap<String, String>,
}

/// What the user says of the sensors; `None` where nothing is said. See [`RolesFile`] for the meaning.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sensors {
    /// Place of the load's sensor, m.
    pub place_m: Option<[f64; 3]>,
    /// Its mounting, deg.
    pub mounting_roll_pitch_yaw_deg: Option<[f64; 3]>,
    /// Age of gyroscopes' samples, s.
    pub gyro_age_s: Option<f64>,
    /// Age of accelerometers' samples, s.
    pub accel_age_s: Option<f64>,
    /// Standard deviation of the bias of the load's accelerometer, m/s².
    pub accel_bias_m_per_s2: Option<f64>,
    /// Standard deviation of the scale error of its gyroscope, relative.
    pub gyro_scale_error: Option<f64>,
    /// Standard deviation of how far its axes stand otherwise, degrees.
    pub mounting_error_deg: Option<f64>,
}

/// A topic and the type of its messages.
type Typed<'a> = (&'a str, String);

/// The topics of these types.
fn of_type(channels: &[Typed], schemas: &[&str]) -> Vec<String> {
    channels
        .iter()
        .filter(|(_, s)| schemas.contains(&s.as_str()))
        .map(|(t, _)| (*t).to_owned())
        .collect()
}

impl Roles {
    /// From the channels (topic, schema) of a recording, and what the user says; the user's word stands over inference, role by role.
    pub fn infer<'a>(
        channels: impl Iterator<Item = (&'a str, &'a str)>,
        user: Option<&RolesFile>,
    ) -> Self {
        let mut channels: Vec<Typed> = channels
            .filter(|(topic, _)| !stands_beside(topic))
            .map(|(topic, schema)| (topic, schema.replacen("/msg/", "/", 1)))
            .collect();
        channels.sort();
        channels.dedup();
        let mut roles = Roles::default();
        roles.fields_of(&channels, user);
        roles.sensors_of(&channels, user);
        roles.beats_of(&channels);
        roles.truth_of(&channels);
        if let Some(user) = user {
            roles.as_said(user, &channels);
        }
        roles.once(&channels);
        roles
    }

    /// What each field of a known type is for.
    fn fields_of(&mut self, channels: &[Typed], user: Option<&RolesFile>) {
        for (schema, role, field) in by_schema() {
            // Rows of one role stand in order of preference; forces may come from several topics of one type.
            if self.patterns.contains_key(&role) {
                continue;
            }
            let mut found: Vec<String> = channels
                .iter()
                .filter(|(t, s)| s == schema && !is_truth(t))
                .map(|(t, _)| format!("{t}.{field}"))
                .collect();
            if !matches!(role, Role::Forces) {
                let takes = |r: &Role| user.is_none_or(|user| user.patterns(*r).is_empty());
                if matches!(role, Role::Height) && [Role::Height, Role::Roll].iter().any(takes) {
                    let topics = found.iter().map(|path| path.trim_end_matches(&field));
                    let topics = topics.map(|t| t.trim_end_matches('.').to_owned());
                    let topics: Vec<String> = topics.collect();
                    self.choose(&topics, "height and angles are taken from this topic");
                }
                found.truncate(1);
            }
            if !found.is_empty() {
                self.patterns.insert(role, found);
            }
        }
    }

    /// Which inertial sensors are on the load, and which on who carries it.
    fn sensors_of(&mut self, channels: &[Typed], user: Option<&RolesFile>) {
        let inertial = of_type(channels, &["sensor_msgs/Imu"]);
        self.halves = halves(&inertial);
        // The gyroscope stands for both: it is sampled at least as fast.
        let stands = |t: &String| !self.halves.contains_key(t) || half(t).is_some_and(|h| h.0);
        let (carriers, others): (Vec<String>, Vec<String>) = inertial
            .into_iter()
            .filter(stands)
            .partition(|t| is_carrier(t));
        if !others.is_empty() {
            let first = preferred(&others);
            let said = user.is_some_and(|user| !user.imu.is_empty());
            if !said && !about_the_load(&first) && !is_body(&first) {
                self.choose(
                    &others,
                    "what is carried is taken to move as this sensor says",
                );
            }
            let also = others.into_iter().filter(|t| about_the_load(t));
            let also: Vec<String> = also.filter(|t| *t != first).collect();
            self.patterns
                .insert(Role::Imu, [vec![first], also].concat());
        }
        if !carriers.is_empty() {
            self.patterns
                .insert(Role::Carriers, natural_order(carriers));
        }
    }

    fn beats_of(&mut self, channels: &[Typed]) {
        let beats = of_type(channels, &["rath.Beat"]).into_iter();
        // Whatever its messages hold: one is a beat.
        let named = channels.iter().filter(|(t, _)| *t == "/beat");
        if let Some(topic) = beats.chain(named.map(|(t, _)| (*t).to_owned())).next() {
            self.patterns.insert(Role::Beats, vec![topic]);
        }
    }

    fn truth_of(&mut self, channels: &[Typed]) {
        let poses = POSES.iter().map(|(schema, ..)| *schema);
        let pose: Vec<&str> = poses.chain(["rath.State"]).collect();
        if let Some(truth) = of_type(channels, &pose).into_iter().find(|t| is_truth(t)) {
            self.patterns.insert(Role::Truth, vec![truth]);
        } else if let Some(state) = of_type(channels, &["rath.State"]).first() {
            self.patterns.insert(Role::Truth, vec![state.clone()]);
        }
    }

    /// What the user says takes the place of what names and types tell.
    fn as_said(&mut self, user: &RolesFile, channels: &[Typed]) {
        self.sensors = Sensors {
            place_m: user.imu_place_m,
            mounting_roll_pitch_yaw_deg: user.imu_mounting_roll_pitch_yaw_deg,
            gyro_age_s: user.gyro_age_s,
            accel_age_s: user.accel_age_s,
            accel_bias_m_per_s2: user.accel_bias_m_per_s2,
            gyro_scale_error: user.gyro_scale_error,
            mounting_error_deg: user.imu_mounting_error_deg,
        };
        let motion = [Role::Height, Role::Roll, Role::Pitch, Role::Yaw];
        let says = |role: &Role| !user.patterns(*role).is_empty();
        let states = !of_type(channels, &["rath.State"]).is_empty();
        let there = |p: &String| channels.iter().any(|(t, _)| matches(p, t));
        let sensed = user.imu.iter().any(there);
        if sensed && !motion.iter().any(says) && !states {
            self.leave_poses_out(motion);
        }
        for role in Role::ALL {
            let mut said = user.patterns(role);
            if said.is_empty() {
                continue;
            }
            if role.is_topic() {
                said = self.topics(role, &said, channels);
            }
            self.patterns.insert(role, said);
            self.said.insert(role);
        }
    }

    /// One sensor is not on the load and on who carries it; and beats are heard in a sound without a role.
    fn once(&mut self, channels: &[Typed]) {
        let load = self.patterns(Role::Imu).iter();
        let load: Vec<String> = load
            .flat_map(|topic| self.device(topic))
            .map(str::to_owned)
            .collect();
        let is_sound = |topic: &String| channels.iter().any(|(t, s)| t == topic && s == SOUND);
        self.leave_out(Role::Carriers, |topic| load.contains(topic));
        self.leave_out(Role::Beats, is_sound);
    }

    /// The topics that patterns of a role name, each once: `*` stands for those that are there, of inertial sensors where some are meant. What is
    /// not there stays, to be told.
    fn topics(
        &mut self,
        role: Role,
        patterns: &[String],
        channels: &[(&str, String)],
    ) -> Vec<String> {
        let what = match role {
            Role::Imu => Some("what is carried is taken to move as this sensor says"),
            Role::Beats => Some("beats are taken from this topic"),
            Role::Truth => Some("estimates are judged by this topic"),
            _ => None,
        };
        let mut out: Vec<String> = Vec::new();
        for pattern in patterns {
            let fit = channels.iter().filter(|(t, _)| matches(pattern, t));
            let (sensors, others): (Vec<_>, Vec<_>) =
                fit.partition(|(_, s)| s == "sensor_msgs/Imu");
            let found = match role {
                Role::Imu | Role::Carriers if !sensors.is_empty() => sensors,
                _ => [sensors, others].concat(),
            };
            let mut found: Vec<String> = found.iter().map(|(t, _)| (*t).to_owned()).collect();
            if found.is_empty() {
                found.push(pattern.clone());
            }
            if role == Role::Carriers {
                found = natural_order(found);
            }
            if let Some(what) = what {
                self.choose(&found, what);
            }
            // A device is one sensor, whichever half names it.
            for topic in found {
                if !self.device(&topic).any(|t| out.iter().any(|o| o == t)) {
                    out.push(topic);
                }
            }
        }
        out
    }

    /// Who names the load's sensor, and no pose, wants its motion from there. A model's own state stays, which is no other body's.
    fn leave_poses_out(&mut self, motion: [Role; 4]) {
        let poses: Vec<String> = (motion.iter())
            .filter_map(|role| self.patterns.remove(role))
            .flatten()
            .collect();
        self.chosen.clear();
        if let Some(pose) = poses.first() {
            let text = "is not looked at for the motion, which the sensor of imu = … tells; name it as roll and height in the file for --roles if it is wanted";
            self.chosen.push((pose.clone(), text.to_owned()));
        }
    }

    /// Leaves topics out of a role.
    fn leave_out(&mut self, role: Role, is_left_out: impl Fn(&String) -> bool) {
        if let Some(topics) = self.patterns.get_mut(&role) {
            topics.retain(|topic| !is_left_out(topic));
            if topics.is_empty() {
                self.patterns.remove(&role);
            }
        }
    }

    /// Remarks what the first of several topics is taken for, where nothing but its name says so.
    fn choose(&mut self, topics: &[String], what: &str) {
        let [topic, others @ ..] = topics else { return };
        if others.is_empty() {
            return;
        }
        let text = format!(
            "{what}, the first by name of {} of its kind; if another is meant ({}), name it in a file for --roles",
            topics.len(),
            others[..others.len().min(8)].join(", ")
        );
        self.chosen.push((topic.clone(), text));
    }

    /// The patterns of a role: paths of signals, or topics, `*` standing for anything.
    pub fn patterns(&self, role: Role) -> &[String] {
        self.patterns.get(&role).map_or(&[], |p| &p[..])
    }

    /// Whether the user said who plays a role.
    pub fn is_said(&self, role: Role) -> bool {
        self.said.contains(&role)
    }

    /// The topic that plays a role.
    pub fn topic(&self, role: Role) -> Option<&str> {
        self.patterns(role).first().map(String::as_str)
    }

    /// The topic that by its name is the other half of an inertial sensor: accelerometer to gyroscope, or the reverse.
    pub fn other_half(&self, topic: &str) -> Option<&str> {
        self.halves.get(topic).map(String::as_str)
    }

    /// The topics of inertial sensors on the load and its carriers, other halves included.
    pub fn inertial(&self) -> Vec<&str> {
        let each = self.patterns(Role::Imu).iter();
        let each = each.chain(self.patterns(Role::Carriers));
        each.flat_map(|topic| self.device(topic)).collect()
    }

    /// A topic and its other half, if it has one.
    pub fn device<'a>(&'a self, topic: &'a str) -> impl Iterator<Item = &'a str> {
        [Some(topic), self.other_half(topic)].into_iter().flatten()
    }

    /// The roles of signals that a path plays.
    pub fn of_signal(&self, path: &str) -> Option<Role> {
        let plays = |(role, patterns): (&Role, &Vec<String>)| {
            (!role.is_topic() && patterns.iter().any(|p| matches(p, path))).then_some(*role)
        };
        self.patterns.iter().find_map(plays)
    }

    /// Whether signals of a topic may play a role.
    pub(crate) fn feeds(&self, topic: &str) -> bool {
        let may = |pattern: &String| {
            let stem = pattern.split('*').next().unwrap_or("");
            topic.starts_with(stem) || stem.starts_with(topic)
        };
        (self.patterns.iter()).any(|(role, p)| !role.is_topic() && p.iter().any(may))
    }

    /// Role and patterns, in printing order.
    pub fn iter(&self) -> impl Iterator<Item = (Role, &[String])> {
        self.patterns.iter().map(|(r, p)| (*r, &p[..]))
    }
}

/// Whether a topic repeats in the recording's own terms what another is about: what `analyze --annotate` found, what `sim replay` was given.
pub(crate) fn stands_beside(topic: &str) -> bool {
    ["/findings/", "/measured/"]
        .iter()
        .any(|p| topic.starts_with(p))
}

fn is_truth(topic: &str) -> bool {
    topic.to_lowercase().contains("truth")
}

/// Whether a topic's name speaks of somebody who carries.
pub(crate) fn is_carrier(topic: &str) -> bool {
    let topic = topic.to_lowercase();
    ["carrier", "bearer", "walker", "person"]
        .iter()
        .any(|word| topic.contains(word))
}

/// Of several IMUs the one whose name speaks of what is carried, else the first by name.
fn preferred(topics: &[String]) -> String {
    topics
        .iter()
        .find(|t| about_the_load(t) || is_body(t))
        .unwrap_or(&topics[0])
        .clone()
}

fn is_body(topic: &str) -> bool {
    topic.to_lowercase().contains("body")
}

/// Whether a topic's name speaks of what is carried.
pub(crate) fn about_the_load(topic: &str) -> bool {
    let topic = topic.to_lowercase();
    ["rath", "palanquin", "palki", "pole", "load"]
        .iter()
        .any(|word| topic.contains(word))
}

/// Whether a topic's name speaks of a gyroscope, or else of an accelerometer, and the rest of it: that of the device.
fn half(topic: &str) -> Option<(bool, String)> {
    let topic = topic.to_lowercase();
    let words = [
        (true, "gyroscope"),
        (true, "gyro"),
        (false, "accelerometer"),
        (false, "accel"),
    ];
    let (is_gyro, word) = words.into_iter().find(|(_, word)| topic.contains(word))?;
    // What no name holds marks the place.
    Some((is_gyro, topic.replacen(word, "\0", 1)))
}

/// Of topics that are halves of one device by their names, each to the other.
fn halves(topics: &[String]) -> BTreeMap<String, String> {
    let mut devices: BTreeMap<String, [Vec<&String>; 2]> = BTreeMap::new();
    for topic in topics {
        if let Some((is_gyro, device)) = half(topic) {
            devices.entry(device).or_default()[usize::from(is_gyro)].push(topic);
        }
    }
    let pairs = devices.values().filter_map(|of| match of {
        [a, g] if a.len() == 1 && g.len() == 1 => Some([a[0], g[0]]),
        _ => None,
    });
    let both = |[a, g]: [&String; 2]| [(a.clone(), g.clone()), (g.clone(), a.clone())];
    pairs.flat_map(both).collect()
}

/// `carrier_2` before `carrier_10`.
fn natural_order(mut names: Vec<String>) -> Vec<String> {
    let number = |name: &str| -> u64 {
        let digits: String = name.chars().filter(char::is_ascii_digit).take(18).collect();
        digits.parse().unwrap_or(0)
    };
    names.sort_by(|a, b| (number(a), a).cmp(&(number(b), b)));
    names
}

/// Whether `path` is of a topic that fits `pattern`: a field of its messages, or its messages themselves where they are bare numbers.
pub fn of_topic(pattern: &str, path: &str) -> bool {
    matches(&format!("{pattern}.*"), path) || matches(pattern, path)
}

/// Whether `path` fits `pattern`, in which `*` stands for any characters, none included.
pub fn matches(pattern: &str, path: &str) -> bool {
    let (p, s) = (pattern.as_bytes(), path.as_bytes());
    let (mut i, mut j, mut star, mut mark) = (0, 0, None, 0);
    while j < s.len() {
        if i < p.len() && p[i] == b'*' {
            star = Some(i);
            mark = j;
            i += 1;
        } else if i < p.len() && p[i] == s[j] {
            i += 1;
            j += 1;
        } else if let Some(at) = star {
            i = at + 1;
            mark += 1;
            j = mark;
        } else {
            return false;
        }
    }
    p[i..].iter().all(|c| *c == b'*')
}

/// What may have been meant by a pattern that nothing fits: the nearest name, as the end of a sentence.
pub fn meant<'a>(pattern: &str, names: impl IntoIterator<Item = &'a str>) -> String {
    let far = |name| (strsim::damerau_levenshtein(name, pattern), name);
    let nearest = names.into_iter().map(far).min_by_key(|(far, _)| *far);
    let near = nearest.filter(|(far, _)| 3 * far <= pattern.len());
    near.map_or(String::new(), |(_, name)| format!("; did you mean {name}?"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bare_number_is_of_its_topic() {
        assert!(of_topic("/n", "/n") && of_topic("/n", "/n.x") && of_topic("/n*", "/nose.x"));
        assert!(!of_topic("/n", "/nose.x") && !of_topic("/n", "/m"));
    }

    #[test]
    fn wildcards() {
        for (pattern, path, fits) in [
            (
                "/imu/rath.angular_velocity.x",
                "/imu/rath.angular_velocity.x",
                true,
            ),
            ("/imu/*", "/imu/rath.angular_velocity.x", true),
            ("*.x", "/imu/rath.angular_velocity.x", true),
            ("*.x", "/imu/rath.angular_velocity.y", false),
            ("/a.n[*]", "/a.n[12]", true),
            ("/a.n[*]", "/a.n[12].x", false),
            ("*a*b*", "xxaxxbxx", true),
            ("*a*b*", "xxbxxaxx", false),
            ("", "", true),
            ("*", "", true),
        ] {
            assert_eq!(matches(pattern, path), fits, "{pattern} {path}");
        }
    }

    #[test]
    fn our_own_topics_are_recognised() {
        let channels = [
            ("/rath/state", "rath.State"),
            ("/handles/forces", "rath.HandleForces"),
            ("/carriers/phases", "rath.Phases"),
            ("/imu/rath", "sensor_msgs/msg/Imu"),
            ("/imu/carrier_10", "sensor_msgs/msg/Imu"),
            ("/imu/carrier_2", "sensor_msgs/msg/Imu"),
        ];
        let roles = Roles::infer(channels.into_iter(), None);
        assert_eq!(roles.of_signal("/rath/state.roll_rad"), Some(Role::Roll));
        assert_eq!(
            roles.of_signal("/handles/forces.normal_n[3]"),
            Some(Role::Forces)
        );
        assert_eq!(roles.of_signal("/handles/forces.compression_m[3]"), None);
        assert_eq!(roles.topic(Role::Imu), Some("/imu/rath"));
        assert_eq!(
            roles.patterns(Role::Carriers),
            ["/imu/carrier_2", "/imu/carrier_10"]
        );
        assert_eq!(roles.topic(Role::Truth), Some("/rath/state"));
    }

    #[test]
    fn one_of_several_is_named() {
        let imu = "sensor_msgs/msg/Imu";
        let chosen = |topics: &[&str], user: Option<&RolesFile>| {
            Roles::infer(topics.iter().map(|t| (*t, imu)), user).chosen
        };
        let several = chosen(&["/imu/b", "/imu/a", "/imu/c"], None);
        assert_eq!(several.len(), 1);
        assert_eq!(several[0].0, "/imu/a");
        assert!(several[0].1.contains("of 3") && several[0].1.contains("/imu/b, /imu/c"));
        assert!(chosen(&["/imu/a", "/imu/rath"], None).is_empty());
        assert!(chosen(&["/imu/a"], None).is_empty());
        let said = RolesFile {
            imu: vec!["/imu/b".into()],
            ..RolesFile::default()
        };
        assert!(chosen(&["/imu/b", "/imu/a"], Some(&said)).is_empty());
        let pose = "geometry_msgs/msg/PoseStamped";
        let poses = [("/odom", pose), ("/aaa", pose), ("/truth/pose", pose)];
        let roles = Roles::infer(poses.into_iter(), None);
        assert_eq!(roles.chosen[0].0, "/aaa");
        assert!(roles.chosen[0].1.contains("(/odom)"));
    }

    #[test]
    fn two_topics_of_one_device_are_one_sensor() {
        let imu = "sensor_msgs/msg/Imu";
        let topics = [
            "/cam/accel/sample",
            "/cam/gyro/sample",
            "/carrier_1/Accelerometer",
            "/carrier_1/Gyroscope",
            "/carrier_2/imu",
        ];
        let roles = |topics: &[&str], said: &str| {
            let user: RolesFile = toml::from_str(said).unwrap();
            Roles::infer(topics.iter().map(|t| (*t, imu)), Some(&user))
        };
        let found = roles(&topics, "");
        assert_eq!(found.patterns(Role::Imu), ["/cam/gyro/sample"]);
        assert!(found.chosen.is_empty(), "{:?}", found.chosen);
        assert_eq!(
            found.patterns(Role::Carriers),
            ["/carrier_1/Gyroscope", "/carrier_2/imu"]
        );
        assert_eq!(found.other_half("/cam/gyro/sample"), Some(topics[0]));
        assert_eq!(found.other_half(topics[2]), Some(topics[3]));
        assert_eq!(found.inertial().len(), 5);
        // Whoever names one half names the device, and whoever names both names it once.
        let found = roles(&topics, "imu = \"/cam/accel/sample\"");
        assert_eq!(found.patterns(Role::Imu), ["/cam/accel/sample"]);
        let found = roles(&topics, "imu = \"/cam/*\"\ncarriers = \"/carrier*\"");
        assert_eq!(found.patterns(Role::Imu), ["/cam/accel/sample"]);
        assert_eq!(found.patterns(Role::Carriers).len(), 2);
        let found = roles(&topics, "imu = \"/carrier_1/Accelerometer\"");
        assert_eq!(found.patterns(Role::Carriers), ["/carrier_2/imu"]);
        // One half alone, and halves of two devices.
        for topics in [&topics[..1], &["/a/gyro", "/b/accel"]] {
            let found = roles(topics, "");
            assert!(topics.iter().all(|t| found.other_half(t).is_none()));
        }
    }

    #[test]
    fn a_pattern_stands_for_the_topics_that_fit_it() {
        let imu = "sensor_msgs/msg/Imu";
        let channels = [
            ("/imu/rath", imu),
            ("/imu/rath_2", imu),
            ("/rath/state", "rath.State"),
            ("/imu/c_10", imu),
            ("/imu/c_2", imu),
            ("/beat", "rath.Beat"),
            ("/audio/drum", "foxglove.RawAudio"),
        ];
        let roles = |said: &str| {
            let user: RolesFile = toml::from_str(said).unwrap();
            Roles::infer(channels.into_iter(), Some(&user))
        };
        let found = roles("imu = \"*rath\"\ncarriers = \"/imu/c_*\"");
        assert_eq!(found.patterns(Role::Imu), ["/imu/rath"]);
        assert_eq!(found.patterns(Role::Carriers), ["/imu/c_2", "/imu/c_10"]);
        assert!(found.chosen.is_empty());
        // Several: one is taken, and it is said.
        let found = roles("imu = \"/imu/rath*\"\ncarriers = [\"/imu/*\", \"/imu/c_2\"]");
        assert_eq!(found.patterns(Role::Imu), ["/imu/rath", "/imu/rath_2"]);
        assert_eq!(found.patterns(Role::Carriers), ["/imu/c_2", "/imu/c_10"]);
        let [(topic, why)] = &found.chosen[..] else {
            panic!("{:?}", found.chosen)
        };
        assert!(topic == "/imu/rath" && why.contains("of 2") && why.contains("/imu/rath_2"));
        // A sensor is one thing, a list is a choice, what is not there stays.
        let found =
            roles("imu = [\"/imu/c_2\", \"/none*\"]\ncarriers = [\"/imu/c_2\", \"/imu/c_10\"]");
        assert_eq!(found.patterns(Role::Imu), ["/imu/c_2", "/none*"]);
        assert_eq!(found.patterns(Role::Carriers), ["/imu/c_10"]);
        assert!(found.chosen.is_empty());
        // Beats are heard in a sound; its messages are none.
        assert_eq!(roles("").topic(Role::Beats), Some("/beat"));
        assert_eq!(roles("beats = \"/audio/drum\"").topic(Role::Beats), None);
    }

    /// The odometry of who carries stands beside the load's sensor.
    #[test]
    fn who_names_the_sensor_wants_the_motion_from_there() {
        let channels = [
            ("/robot1/odom", "nav_msgs/msg/Odometry"),
            ("/payload/imu", "sensor_msgs/msg/Imu"),
        ];
        let with = |text: &str| {
            let user: RolesFile = toml::from_str(text).unwrap();
            Roles::infer(channels.into_iter(), Some(&user))
        };
        let moves = |roles: &Roles| !roles.patterns(Role::Roll).is_empty();
        assert!(moves(&with("")));
        let sensed = with("imu = \"/payload/*\"");
        assert!(!moves(&sensed));
        let [(topic, why)] = &sensed.chosen[..] else {
            panic!("{:?}", sensed.chosen)
        };
        assert!(
            topic.starts_with("/robot1/odom") && why.contains("imu = "),
            "{why}"
        );
        assert!(moves(&with("imu = \"/none\"")));
        let said = "imu = \"/payload/imu\"\nroll = \"/robot1/odom.pose.pose.orientation.roll\"";
        assert!(moves(&with(said)));
    }

    #[test]
    fn every_type_of_pose_tells_how_the_load_moves() {
        for (schema, place, turn) in POSES {
            let roles = Roles::infer([("/p", *schema)].into_iter(), None);
            assert_eq!(roles.patterns(Role::Height), [format!("/p.{place}.z")]);
            assert_eq!(roles.patterns(Role::Yaw), [format!("/p.{turn}.yaw")]);
            let truth = Roles::infer([("/truth", *schema)].into_iter(), None);
            assert_eq!(truth.topic(Role::Truth), Some("/truth"));
            for axis in ["x", "y", "z", "w"] {
                assert!(
                    crate::field::is_of_truth(&format!("{turn}.{axis}")),
                    "{schema}"
                );
            }
            assert!(crate::field::is_of_truth(&format!("{place}.z")), "{schema}");
        }
    }

    #[test]
    fn a_true_pose_is_no_measurement_and_the_user_is_right() {
        let channels = [
            ("/truth/pose", "geometry_msgs/msg/PoseStamped"),
            ("/imu/data", "sensor_msgs/msg/Imu"),
        ];
        let roles = Roles::infer(channels.into_iter(), None);
        assert_eq!(roles.patterns(Role::Height), [""; 0]);
        assert_eq!(roles.topic(Role::Truth), Some("/truth/pose"));
        let user = RolesFile {
            height: Some("/x.z".into()),
            ..RolesFile::default()
        };
        let roles = Roles::infer(channels.into_iter(), Some(&user));
        assert_eq!(roles.of_signal("/x.z"), Some(Role::Height));
        assert_eq!(roles.topic(Role::Imu), Some("/imu/data"));
    }
}
