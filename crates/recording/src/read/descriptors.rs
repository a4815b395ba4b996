//! The `FileDescriptorSet`s of a recording, parsed.

use std::collections::{HashMap, HashSet};
use std::sync::{Arc, Mutex, PoisonError};

use prost::Message as _;
use prost_reflect::DescriptorPool;

use super::decoders::NoDecoder;

/// Those that were parsed, by where they lie: hundreds of channels may share one that is large.
#[derive(Default)]
pub(super) struct Pools(Mutex<HashMap<usize, Result<DescriptorPool, NoDecoder>>>);

impl Pools {
    /// The descriptors of a schema.
    pub fn of(&self, schema: &Arc<[u8]>) -> Result<DescriptorPool, NoDecoder> {
        let mut pools = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let known = pools.entry(schema.as_ptr().addr());
        known.or_insert_with(|| pool(schema)).clone()
    }
}

/// The descriptors of the set in the file.
fn pool(schema: &[u8]) -> Result<DescriptorPool, NoDecoder> {
    let mut set = prost_types::FileDescriptorSet::decode(schema)
        .map_err(|problem| format!("the schema is no FileDescriptorSet: {problem}"))?;
    // Writers repeat files, and some leave out what Google defines.
    let mut present = HashSet::new();
    set.file
        .retain(|file| present.insert(file.name().to_owned()));
    let needed: Vec<String> = set
        .file
        .iter()
        .flat_map(|file| file.dependency.iter().cloned())
        .collect();
    let global = DescriptorPool::global();
    let mut missing = Vec::new();
    for name in needed {
        if !present.insert(name.clone()) {
            continue;
        }
        match global.get_file_by_name(&name) {
            Some(file) => set.file.push(file.file_descriptor_proto().clone()),
            None => missing.push(name),
        }
    }
    let known = |syntax: &str| ["proto2", "proto3", ""].contains(&syntax);
    if let Some(file) = set.file.iter().find(|file| !known(file.syntax())) {
        let problem = format!(
            "the FileDescriptorSet's file {:?} is written in {:?}; expected proto2 or proto3",
            file.name(),
            file.syntax()
        );
        return Err(match file.syntax() {
            "editions" => NoDecoder::Unread(problem),
            _ => NoDecoder::BadSchema(problem),
        });
    }
    // The library indexes past its files while it words some of its errors: a schema that makes it panic is one that does not parse.
    let parsed = std::panic::catch_unwind(|| DescriptorPool::from_file_descriptor_set(set))
        .map_err(|_| "the FileDescriptorSet is not consistent".to_owned())?;
    let pool = parsed.map_err(|problem| {
        if missing.is_empty() {
            format!("the FileDescriptorSet is not consistent: {problem}")
        } else {
            format!(
                "the FileDescriptorSet lacks the imported {}",
                missing.join(", ")
            )
        }
    })?;
    Ok(pool)
}
