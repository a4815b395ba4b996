//! The scenes that come with the program.

/// Name and TOML text of every built-in scene.
pub const BUILTIN: &[(&str, &str)] = &[
    ("music", include_str!("../../scenes/music.toml")),
    ("baseline", include_str!("../../scenes/baseline.toml")),
    ("field-imu", include_str!("../../scenes/field-imu.toml")),
    (
        "strict-contact",
        include_str!("../../scenes/strict-contact.toml"),
    ),
    (
        "one-handle-drop",
        include_str!("../../scenes/one-handle-drop.toml"),
    ),
    (
        "eight-carriers",
        include_str!("../../scenes/eight-carriers.toml"),
    ),
    ("long-pole", include_str!("../../scenes/long-pole.toml")),
    (
        "detuned-beat",
        include_str!("../../scenes/detuned-beat.toml"),
    ),
    (
        "tempo-change",
        include_str!("../../scenes/tempo-change.toml"),
    ),
    ("tumble", include_str!("../../scenes/tumble.toml")),
    ("stand-still", include_str!("../../scenes/stand-still.toml")),
];

/// The text of a built-in scene.
pub fn builtin(name: &str) -> Option<&'static str> {
    BUILTIN
        .iter()
        .find(|(n, _)| *n == name)
        .map(|(_, text)| *text)
}
