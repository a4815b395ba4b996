//! Where the archive is, and what its `stats.json` calls the metrics.

use std::path::PathBuf;

/// The archive's folder.
pub fn folder() -> PathBuf {
    std::env::var_os("RATH_ARCHIVE")
        .map(PathBuf::from)
        .expect("RATH_ARCHIVE names the folder of the archive, by an absolute path")
}

/// Our name and the archive's.
pub const NUMBERS: [(&str, &str); 11] = [
    ("z_mean_m", "y_mean_m"),
    ("rms_z_m", "rms_y_m"),
    ("dz_pp_m", "p2p_y_m"),
    ("rms_roll_deg", "rms_roll_deg"),
    ("rms_yaw_deg", "rms_pitch_deg"),
    ("growth_ratio", "growth_ratio_y"),
    ("contact_loss_mean", "contact_loss_avg"),
    ("peak_hz", "peak_freq_hz"),
    ("h2_ratio", "H2_ratio"),
    ("synchrony", "synchrony_index"),
    ("roll_excess_s", "time_roll_excess_s"),
];

/// The same for metrics that have a number per handle.
pub const PER_HANDLE: [(&str, &str); 3] = [
    ("contact_loss_mean", "contact_loss_per_carrier"),
    ("force_mean_n", "Fy_mean_per_carrier_N"),
    ("force_sd_n", "Fy_std_per_carrier_N"),
];
