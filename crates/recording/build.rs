//! Compiles `schemas/` into Rust types and into the descriptor sets that go into every file we write, in Rust, without a system `protoc`.

use std::{env, fs, path::PathBuf};

/// Messages that a channel may carry: package, name. Each needs `schemas/PACKAGE/NAME.proto`.
const MESSAGES: &[(&str, &str)] = &[
    ("rath", "State"),
    ("rath", "Phases"),
    ("rath", "HandleForces"),
    ("rath", "Energy"),
    ("rath", "Beat"),
    ("foxglove", "SceneUpdate"),
    ("foxglove", "RawAudio"),
];

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let schemas = PathBuf::from(env::var("CARGO_MANIFEST_DIR")?).join("../../schemas");
    let out = PathBuf::from(env::var("OUT_DIR")?);
    println!("cargo::rerun-if-changed={}", schemas.display());

    let mut names = Vec::new();
    for (package, name) in MESSAGES {
        let file = format!("{package}/{name}.proto");
        // What goes into a recording: the message with all that it imports, without comments.
        let mut compiler = protox::Compiler::new([&schemas])?;
        compiler
            .include_imports(true)
            .include_source_info(false)
            .open_file(&file)?;
        fs::write(
            out.join(format!("{package}.{name}.bin")),
            compiler.encode_file_descriptor_set(),
        )?;
        names.push(file);
    }
    let set = protox::compile(&names, [&schemas])?;
    prost_build::Config::new().compile_fds(set)?;
    Ok(())
}
