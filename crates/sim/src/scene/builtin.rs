//! The scenes that come with the program.

/// Name and TOML text of every built-in scene.
pub const BUILTIN: &[(&str, &str)] = &[
    ("music", include_str!("../../scenes/music.toml")),
    ("baseline", include_str!("../../scenes/baseline.toml")),
    ("strict-contact", include_str!("../../scenes/strict-contact.toml")),
];

/// The text of a built-in scene.
pub fn builtin(name: &str) -> Option<&'static str> {
    BUILTIN.iter().find(|(n, _)| *n == name).map(|(_, text)| *text)
}
