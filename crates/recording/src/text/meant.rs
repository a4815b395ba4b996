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

/// The question behind a sentence that found no `word`, with a space before it; empty where no name is near.
pub fn did_you_mean<'a>(word: &str, names: impl Iterator<Item = &'a str>) -> String {
    nearest(word, names).map_or(String::new(), |name| format!(" Did you mean `{name}`?"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slip_and_a_forgotten_unit_are_found() {
        let names = || ["onset_s", "beat_hz", "strength_rad_per_s"].into_iter();
        assert_eq!(nearest("onst_s", names()), Some("onset_s"));
        assert_eq!(nearest("strength", names()), Some("strength_rad_per_s"));
        assert_eq!(nearest("moon", names()), None);
        assert_eq!(did_you_mean("beat", names()), " Did you mean `beat_hz`?");
        assert_eq!(did_you_mean("moon", names()), "");
    }
}
