//! The Rerun bridge: a recording, with what `analyze` finds in it, as something to look at.
//!
//! [`load::load`] turns a recording into a [`take::Take`], [`draw`] turns that into Rerun's entities and a layout, a
//! [`store::Sink`] takes them: a file, a connection, a viewer's standard input.

pub mod blueprint;
pub mod draw;
pub mod live;
pub mod load;
pub mod palette;
pub mod store;
pub mod take;
pub mod thin;
pub mod viewer;

use std::hash::{DefaultHasher, Hash, Hasher};

use blueprint::Play;
use recording::read::Recording;
use store::{Progress, Sink, Store};
use take::Take;

/// The id under which the viewer keeps a recording: the same for the same file, another for another.
pub fn recording_id(name: &str, recording: &Recording) -> String {
    let (info, scene) = (recording.info(), recording.attachment("scene.toml"));
    let mut hasher = DefaultHasher::new();
    (name, info.start_ns, &info.library, &info.metadata, scene).hash(&mut hasher);
    format!("{:016x}", hasher.finish())
}

/// Sends a whole recording and its layout.
pub fn send(sink: &mut dyn Sink, id: &str, take: &Take) -> anyhow::Result<()> {
    let sent = send_part(sink, id, take, None)?;
    blueprint::send(sink, &format!("{id}-views"), &sent.layout, Play::Playing)
}

/// What [`send_part`] sent.
pub struct Sent {
    /// The layout of the views for it.
    pub layout: blueprint::Node,
    /// How far it got.
    pub progress: Progress,
}

/// Sends what is new since `progress`.
pub fn send_part(
    sink: &mut dyn Sink,
    id: &str,
    take: &Take,
    progress: Option<Progress>,
) -> anyhow::Result<Sent> {
    let mut store = Store::recording(sink, id, &take.name, take.start_ns, progress)?;
    let layout = draw::all(&mut store, take)?;
    Ok(Sent {
        layout,
        progress: store.into_progress(),
    })
}
