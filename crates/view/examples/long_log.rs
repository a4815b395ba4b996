//! Writes a long log of many inertial sensors, to measure with: `long_log OUT.mcap [MINUTES] [SENSORS] [HZ]` (60, 10, 1000).
//!
//! Every sensor turns and shakes at its own gait frequency, with noise of a common 16-bit sensor and its quantisation.

use recording::cdr::Imu;
use recording::topics::MessageKind;
use recording::write::{RecordingWriter, WriterOptions};

fn main() -> anyhow::Result<()> {
    let mut arguments = std::env::args().skip(1);
    let out = arguments
        .next()
        .ok_or_else(|| anyhow::anyhow!("usage: long_log OUT.mcap [MINUTES] [SENSORS] [HZ]"))?;
    let mut number = |default: u64| {
        arguments
            .next()
            .map_or(Ok(default), |text| text.parse::<u64>())
    };
    let (minutes, sensors, hz) = (number(60)?, number(10)?, number(1000)?);
    let mut writer = RecordingWriter::create(out.as_ref(), &WriterOptions::default())?;
    let mut channels = Vec::new();
    for i in 1..=sensors {
        channels.push(writer.channel(&format!("/imu/sensor_{i}"), MessageKind::Imu)?);
    }
    let start_ns = 1_700_000_000_000_000_000i64;
    let mut noise = 1u64;
    let mut draw = || {
        noise = noise
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (noise >> 40) as f64 / f64::from(1u32 << 24) - 0.5
    };
    // Ranges of ±2000 °/s and ±16 g in 16 bits.
    let (gyro_step, accel_step) = (2000f64.to_radians() / 32768.0, 16.0 * 9.80665 / 32768.0);
    for k in 0..minutes * 60 * hz {
        let t_s = k as f64 / hz as f64;
        let t_ns = start_ns + (k * 1_000_000_000 / hz) as i64;
        for (i, channel) in channels.iter().enumerate() {
            let (sin, cos) = (std::f64::consts::TAU * (1.8 + 0.04 * i as f64) * t_s).sin_cos();
            let gyro = [0.3 * sin, 0.1 * cos, 0.0]
                .map(|w| ((w + 0.02 * draw()) / gyro_step).round() * gyro_step);
            let accel = [0.4 * cos, 0.0, 9.81 + 2.0 * sin]
                .map(|a| ((a + 0.1 * draw()) / accel_step).round() * accel_step);
            writer.message(*channel, t_ns, &Imu::raw(t_ns, "sensor", gyro, accel))?;
        }
    }
    Ok(writer.finish()?)
}
