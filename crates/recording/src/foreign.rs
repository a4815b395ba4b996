//! Files of other programs that people take for a log: what they are and what makes one of them.

/// A table of Excel, of the old kind or of the new.
pub(crate) const EXCEL: &str = "a table of Excel; export CSV instead";

/// How a file begins, in up to 8 bytes, what it is then, and what to do with it.
const KINDS: &[(&[u8], &str)] = &[
    (
        b"\x89MCAP0\r\n",
        "a recording (MCAP) already; `analyze` reads it as it is",
    ),
    (
        b"#ROSBAG",
        "a ROS 1 bag; `mcap convert` makes a recording of it",
    ),
    (
        b"SQLite f",
        "a ROS 2 bag in SQLite, or another database; `mcap convert` makes a recording of a bag",
    ),
    (
        b"ULog\x01\x12\x35",
        "a PX4 log; its `ulog2csv` makes a CSV of it for `analyze ingest --layout`",
    ),
    (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", EXCEL),
    (b"\x1f\x8b", "packed with gzip; unpack it first"),
    (b"\x28\xb5\x2f\xfd", "packed with zstd; unpack it first"),
    (b"BZh", "packed with bzip2; unpack it first"),
    (b"\xfd7zXZ", "packed with xz; unpack it first"),
    (b"7z\xbc\xaf\x27\x1c", "packed with 7-Zip; unpack it first"),
];

/// What a file that begins so is, and what to do with it, as the end of a sentence that begins with "it is".
pub(crate) fn kind(begin: &[u8]) -> Option<&'static str> {
    let found = KINDS.iter().find(|(magic, _)| begin.starts_with(magic));
    found.map(|(_, what)| *what)
}
