//! Inertial sensors, a tab each: angular velocity, specific force, estimated roll and pitch, and both spectra. Other topics: their curves.

use analyze::spectrum::Spectrum;

use super::Panel;
use super::series::{Line, plot, spread};
use super::spectra::{self, Curve};
use crate::blueprint::View;
use crate::palette;
use crate::store::Store;
use crate::take::{self, Sensor, Take};

/// Up to this frequency a sensor's spectra are drawn where no line says otherwise: people move below it.
const TOP_HZ: f64 = 8.0;
/// Up to so many times the line's frequency, at least 4 Hz.
const TOP_TIMES: f64 = 3.2;
/// Where the line of a gait or of a shaken load is looked for, Hz.
const GAIT_HZ: [f64; 2] = [0.5, 4.0];

/// Draws sensors and other topics; a panel for each.
pub fn draw(store: &mut Store<'_>, take: &Take) -> anyhow::Result<Vec<Panel>> {
    let mut out = Vec::new();
    for sensor in &take.imus {
        // What `analyze` estimates from the load's sensor stands over the display's own estimate.
        let known =
            take.main_imu.as_ref() == Some(&sensor.topic) && !take.inputs.roll_rad.is_empty();
        out.extend(self::sensor(store, sensor, !known, take)?);
    }
    for topic in &take.topics {
        out.push(self::topic(store, topic, take.growing)?);
    }
    Ok(out)
}

/// The place in the entity tree of what is drawn of a topic, or of a part of that.
fn place(store: &mut Store<'_>, topic: &str, part: &str) -> String {
    let plain = |c: char| match c.is_alphanumeric() || "/_-".contains(c) {
        true => c,
        false => '_',
    };
    let clean: String = topic.chars().map(plain).collect();
    let part_clean = part.replace(['/', '^', '.'], "_");
    let levels = clean.split('/').chain([part_clean.as_str()]);
    let levels = levels.filter(|level| !level.is_empty());
    let wanted: String = levels.map(|level| format!("/{level}")).collect();
    store.place((topic, part), format!("/topics{wanted}"))
}

fn sensor(
    store: &mut Store<'_>,
    sensor: &Sensor,
    attitude: bool,
    take: &Take,
) -> anyhow::Result<Option<Panel>> {
    let xyz = "x vermilion, y green, z blue";
    let mut plots: Vec<View> = Vec::new();
    let groups: [(&str, &[take::Curve], String); 3] = [
        (
            "gyro",
            &sensor.gyro,
            format!("{} angular velocity [rad/s] ({xyz})", sensor.topic),
        ),
        (
            "accel",
            &sensor.accel,
            // The first plot names the sensor.
            if sensor.gyro.is_empty() {
                format!("{} specific force [m/s²] ({xyz})", sensor.topic)
            } else {
                format!("Specific force [m/s²] ({xyz})")
            },
        ),
        (
            "attitude",
            &sensor.attitude,
            "Estimated roll (vermilion), pitch (blue) [deg]".to_owned(),
        ),
    ];
    for (name, curves, title) in groups {
        let colors = if name == "attitude" {
            [palette::VERMILION, palette::BLUE, palette::WHITE]
        } else {
            palette::XYZ.map(|(color, _)| color)
        };
        let made: Vec<Line<'_>> = curves
            .iter()
            .zip(colors)
            .filter_map(|(c, color)| Line::new(&c.name, &c.name, color, &c.times_ns, &c.values[..]))
            .collect();
        if made.is_empty() || (name == "attitude" && !attitude) {
            continue;
        }
        let path = place(store, &sensor.topic, name);
        let range = spread(&made, take.growing);
        // Other topics may be placed below it: `/imu/gyro` beside `/imu`. An axis without values may get some while the recording grows.
        let paths = curves.iter().map(|c| format!("{path}/{}", c.name));
        plots.push(plot(store, title, &path, made, range)?.contents(paths));
    }
    // One f for all of a recording; where nothing tells it, the sensor's own line.
    let f_hz = spectra::drive_hz(take)
        .or_else(|| gait_line(&sensor.accel_spectra))
        .or_else(|| gait_line(&sensor.gyro_spectra));
    let top_hz = f_hz.map_or(TOP_HZ, |f_hz| (TOP_TIMES * f_hz).clamp(4.0, TOP_HZ));
    let mut small: Vec<View> = Vec::new();
    let groups = [
        (
            "accel_spectra",
            &sensor.accel_spectra,
            "Specific force, dB below its peak",
        ),
        (
            "gyro_spectra",
            &sensor.gyro_spectra,
            "Angular velocity, dB below its peak",
        ),
    ];
    for (name, found, title) in groups {
        let curves: Vec<Curve<'_>> = found
            .iter()
            .zip(["x", "y", "z"])
            .zip(palette::XYZ)
            .map(|((spectrum, entity), (color, _))| Curve {
                entity,
                spectrum,
                color,
            })
            .collect();
        let path = place(store, &sensor.topic, name);
        // One reference for the three axes, so that they can be compared.
        let peak = curves
            .iter()
            .map(|c| spectra::peak(c.spectrum, top_hz))
            .fold(0.0, f64::max);
        let reference = vec![peak; curves.len()];
        small.extend(spectra::drawing(
            store, &path, title, &curves, &reference, f_hz, top_hz,
        )?);
    }
    Ok((!plots.is_empty() || !small.is_empty()).then_some(Panel {
        name: sensor.topic.clone(),
        is_sensor: true,
        plots,
        small,
    }))
}

/// The strongest line of all three axes together between 0.5 and 4 Hz, Hz; `None` where nothing stands out tenfold above the median there.
fn gait_line(spectra: &[Spectrum]) -> Option<f64> {
    let first = spectra.first()?;
    let sum: Vec<f64> = (0..first.hz.len())
        .map(|k| spectra.iter().filter_map(|s| s.power.get(k)).sum())
        .collect();
    let band: Vec<usize> = (0..first.hz.len())
        .filter(|k| (GAIT_HZ[0]..=GAIT_HZ[1]).contains(&first.hz[*k]))
        .collect();
    let best = *band.iter().max_by(|a, b| sum[**a].total_cmp(&sum[**b]))?;
    let mut sorted: Vec<f64> = band.iter().map(|k| sum[*k]).collect();
    sorted.sort_by(f64::total_cmp);
    (sum[best] > 10.0 * sorted[sorted.len() / 2]).then(|| {
        let all = Spectrum {
            power: sum,
            ..first.clone()
        };
        all.refine(best)
    })
}

/// A title names no more curves than this; a legend names the others.
const NAMED: usize = 4;

fn topic(store: &mut Store<'_>, topic: &take::Topic, growing: bool) -> anyhow::Result<Panel> {
    let mut plots = Vec::new();
    for (k, (unit, curves)) in topic.plots.iter().enumerate() {
        // Of several without a unit, each has a place of its own.
        let path = match unit.as_str() {
            "" if k > 0 => place(store, &topic.name, &(k + 1).to_string()),
            unit => place(store, &topic.name, unit),
        };
        let mut names = Vec::new();
        let mut made = Vec::new();
        for (i, c) in curves.iter().enumerate() {
            let (color, word) = palette::carrier(i);
            let entity = format!("f{i}");
            if let Some(line) = Line::new(entity, &c.name, color, &c.times_ns, &c.values[..]) {
                names.push(format!("{} ({word})", c.name));
                made.push(line);
            }
        }
        let paths: Vec<String> = made
            .iter()
            .map(|l| format!("{path}/{}", l.entity))
            .collect();
        let named = names.len() <= NAMED;
        let shown = match named {
            true => names.join(", "),
            false => format!("{} fields", names.len()),
        };
        let unit = if unit.is_empty() {
            String::new()
        } else {
            format!(" [{unit}]")
        };
        let title = format!("{}: {shown}{unit}", topic.name);
        let range = spread(&made, growing);
        let view = plot(store, title, &path, made, range)?.contents(paths);
        plots.push(if named { view } else { view.legend() });
    }
    Ok(Panel {
        name: topic.name.clone(),
        is_sensor: false,
        plots,
        small: Vec::new(),
    })
}
