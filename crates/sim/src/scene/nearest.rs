//! What somebody may have meant.

/// The name nearest to `word` when it is near enough to be a slip, or else the only one that goes on from it, as with a unit.
pub fn nearest<'a>(word: &str, names: impl Iterator<Item = &'a str>) -> Option<&'a str> {
    let names: Vec<&str> = names.collect();
    let near = |n: &&'a str| (strsim::damerau_levenshtein(word, n), *n);
    let slip = names.iter().map(near).min();
    let slip = slip.filter(|(d, n)| *d <= 1 + n.len().max(word.len()) / 3);
    let mut longer = names.iter().filter(|n| n.starts_with(&format!("{word}_")));
    match (slip, longer.next(), longer.next()) {
        (Some((_, name)), ..) => Some(name),
        (None, Some(name), None) => Some(name),
        _ => None,
    }
}
