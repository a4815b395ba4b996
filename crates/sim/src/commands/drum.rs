//! `sim drum`: the drum of a scene as a WAV file.

use super::Asked;
use anyhow::{Context, Result, anyhow};
use recording::whole::write_whole;
use sim::model::Model;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Arguments of `sim drum`.
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  sim drum music --out drum.wav\n  sim drum tempo-change --set effects.drum.noise=0.05 --out drum.wav"
)]
pub struct Args {
    #[command(flatten)]
    asked: Asked,
    /// Where to write.
    #[arg(long, short, value_name = "FILE.wav", default_value = "drum.wav")]
    out: PathBuf,
}

/// Writes the sound; the file appears whole or not at all.
pub fn run(args: &Args) -> Result<()> {
    super::is_file(&args.out)?;
    super::may_write(&args.out, "wav", &[Path::new(&args.asked.scene)])?;
    let mut scene = args.asked.load()?;
    if scene.effects.music.is_none() {
        return Err(anyhow!(
            "the scene `{}` has no effects.music, so there is no drum to hear",
            scene.name
        ));
    }
    scene.effects.drum.get_or_insert_default();
    sim::scene::check(&scene).map_err(|p| anyhow!("{}: {}", p.key, p.message))?;
    let model = Model::new(&scene);
    let track = model.track().context("a scene with a drum has a track")?;
    let wav = track.wav().map_err(|e| anyhow!(e))?;
    write_whole(&args.out, |file| file.write_all(&wav))
        .with_context(|| format!("cannot write {}", args.out.display()))?;
    recording::note!(
        "{}: {} strokes in {} s at {} Hz",
        args.out.display(),
        track.strokes.len(),
        scene.duration_s,
        track.rate_hz
    );
    Ok(())
}
