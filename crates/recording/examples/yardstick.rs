//! Makes the yardstick of reading: inertial logs of ten devices at 1 kHz, `sensor_msgs/msg/Imu` in CDR, 1 MiB zstd chunks with checksums.
//!
//! ```text
//! cargo run --release -p recording --example yardstick -- yardstick.mcap [MESSAGES]
//! ```
//! 1.84 million messages (the default) are about 100 MB; ten times as many about 1 GB. The numbers are a walk at 2 Hz with harmonics
//! and noise, rounded to the single precision that sensors' drivers work in.

use std::path::Path;

use recording::{
    cdr,
    topics::MessageKind,
    write::{RecordingWriter, WriterOptions},
};

const DEVICES: usize = 10;

/// A 64-bit congruence (Knuth's MMIX) as noise between −1 and 1.
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        // The high bits are the good ones; two draws fill the mantissa.
        let high = self.0 >> 37;
        self.0 = self
            .0
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        ((high << 26 | self.0 >> 38) as f64) / (1u64 << 52) as f64 - 1.0
    }
}

/// A number as a driver gives it.
fn single(value: f64) -> f64 {
    f64::from(value as f32)
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().collect();
    let path = arguments
        .get(1)
        .ok_or("usage: yardstick OUT.mcap [MESSAGES]")?;
    let messages: usize = arguments
        .get(2)
        .map_or(Ok(1_840_000), |count| count.parse())?;
    let options = WriterOptions {
        chunk_bytes: 1 << 20,
        chunk_ns: i64::MAX,
        zstd_level: 3,
        ..WriterOptions::default()
    };
    let mut writer = RecordingWriter::create(Path::new(path), &options)?;
    let mut channels = Vec::new();
    for device in 0..DEVICES {
        channels.push(writer.channel(&format!("/imu/device_{device}"), MessageKind::Imu)?);
    }
    let mut noise = Noise(1);
    for index in 0..messages {
        let (sample, device) = (index / DEVICES, index % DEVICES);
        let t_ns = 1_700_000_000_000_000_000 + sample as i64 * 1_000_000 + device as i64 * 1_000;
        let phase = sample as f64 * 1e-3 * std::f64::consts::TAU * 2.0 + device as f64;
        let rate = std::array::from_fn(|axis| {
            single(0.3 * (phase + axis as f64).sin() + 0.05 * noise.next())
        });
        let force = std::array::from_fn(|axis| {
            let rest = if axis == 2 { 9.81 } else { 0.0 };
            single(rest + (phase * (axis + 1) as f64).cos() + 0.2 * noise.next())
        });
        writer.message(
            channels[device],
            t_ns,
            &cdr::Imu::raw(t_ns, "imu_link", rate, force),
        )?;
    }
    writer.finish()?;
    Ok(())
}
