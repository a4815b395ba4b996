//! Colours, as 0xRRGGBBAA: those of Okabe and Ito, which colour-blind people tell apart, on a dark ground.

use recording::load::Load;

/// Behind scenes and drawings.
pub const BACKGROUND: u32 = 0x16181C_FF;
/// The ground.
pub const GROUND: u32 = 0x3A3F45_FF;
/// Lines on the ground, axes' grids.
pub const GRID: u32 = 0x5C646D_FF;
/// Axes and their numbers.
pub const AXIS: u32 = 0xB4BBC4_FF;
/// The carried body.
pub const BODY: u32 = 0xC79A5B_FF;
/// Poles.
pub const POLE: u32 = 0x8A6240_FF;
/// What is most important in a picture.
pub const WHITE: u32 = 0xF2F4F7_FF;
/// Limits, thresholds, chance levels.
pub const LIMIT: u32 = 0x9AA3AD_FF;

/// Blue.
pub const BLUE: u32 = 0x56B4E9_FF;
/// Orange.
pub const ORANGE: u32 = 0xE69F00_FF;
/// Green.
pub const GREEN: u32 = 0x009E73_FF;
/// Vermilion.
pub const VERMILION: u32 = 0xD55E00_FF;
/// Yellow.
pub const YELLOW: u32 = 0xF0E442_FF;
/// Purple.
pub const PURPLE: u32 = 0xCC79A7_FF;
/// Deep blue, lightened for a dark ground.
pub const DEEP: u32 = 0x4C8BD9_FF;
/// Grey.
pub const GREY: u32 = 0xBBBBBB_FF;

/// So many carriers have colours of their own.
pub const CARRIERS: usize = 8;

/// A carrier's colour and its name; they repeat after [`CARRIERS`].
pub fn carrier(number: usize) -> (u32, &'static str) {
    const COLORS: [(u32, &str); CARRIERS] = [
        (BLUE, "blue"),
        (ORANGE, "orange"),
        (PURPLE, "purple"),
        (YELLOW, "yellow"),
        (GREEN, "green"),
        (VERMILION, "vermilion"),
        (DEEP, "deep blue"),
        (GREY, "grey"),
    ];
    COLORS[number % CARRIERS]
}

/// A handle by what it carries.
pub fn load(load: Load) -> u32 {
    match load {
        Load::Loaded => DEEP,
        Load::NearlyUnloaded => YELLOW,
        Load::Slack => VERMILION,
        Load::Pulled => PURPLE,
    }
}

/// Axes x, y, z of a sensor and the names of their colours.
pub const XYZ: [(u32, &str); 3] = [(VERMILION, "vermilion"), (GREEN, "green"), (BLUE, "blue")];
