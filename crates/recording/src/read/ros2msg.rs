//! Message definitions of ROS (`ros2msg` and `ros1msg`): the text in the file becomes [`Types`].
//!
//! A definition is the message's own text, then each type that it needs after a line of `=` and a line `MSG: package/Name`.

use std::collections::HashMap;

use super::types::{Prim, Struct, Type, Types};

/// Which dialect of the language.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Dialect {
    Ros1,
    Ros2,
}

/// A field as written, its type not yet resolved.
struct RawField<'a> {
    base: &'a str,
    suffix: Suffix,
    name: &'a str,
}

#[derive(Clone, Copy)]
enum Suffix {
    One,
    Array(usize),
    Sequence,
}

/// Parses the definition of message `name`.
pub(super) fn parse(name: &str, text: &str, dialect: Dialect) -> Result<Types, String> {
    let mut raw: Vec<(String, Vec<RawField<'_>>)> = vec![(short(name), Vec::new())];
    let mut separator = false;
    for (number, line) in text.lines().enumerate() {
        let line = line.trim();
        if line.len() >= 3 && line.bytes().all(|byte| byte == b'=') {
            separator = true;
            continue;
        }
        if separator && let Some(name) = line.strip_prefix("MSG:") {
            raw.push((short(name.trim()), Vec::new()));
            separator = false;
            continue;
        }
        separator = false;
        let field =
            parse_line(line).map_err(|problem| format!("line {}: {problem}", number + 1))?;
        if let (Some(field), Some((_, fields))) = (field, raw.last_mut()) {
            fields.push(field);
        }
    }

    let mut index = HashMap::new();
    for (position, (name, _)) in raw.iter().enumerate() {
        // The first definition of a name counts; copies repeat it.
        index.entry(name.clone()).or_insert(position);
    }
    let mut types = Types::default();
    types.structs.extend(raw.iter().map(|(name, _)| Struct {
        name: name.clone(),
        ..Struct::default()
    }));
    for (position, (owner, fields)) in raw.iter().enumerate() {
        for field in fields {
            let base = resolve(field.base, owner, dialect, &index, &mut types)?;
            let kind = match field.suffix {
                Suffix::One => base,
                Suffix::Array(count) => Type::Array(Box::new(base), count),
                Suffix::Sequence => Type::Sequence(Box::new(base)),
            };
            types.structs[position]
                .fields
                .push((field.name.to_owned(), kind));
        }
    }
    types.check_finite()?;
    Ok(types)
}

/// A type's name without `/msg/` (or `/srv/`, `/action/`).
fn short(name: &str) -> String {
    let mut parts = name.split('/');
    match (parts.next(), parts.next_back()) {
        (Some(package), Some(last)) => format!("{package}/{last}"),
        _ => name.to_owned(),
    }
}

/// One line: a field, or nothing for blanks, comments and constants.
fn parse_line(line: &str) -> Result<Option<RawField<'_>>, String> {
    if line.is_empty() || line.starts_with('#') {
        return Ok(None);
    }
    let Some(space) = line.find(char::is_whitespace) else {
        return Err(format!("expected a type and a name, found {line:?}"));
    };
    let (kind, rest) = (&line[..space], line[space..].trim_start());
    let end = rest
        .find(|c: char| !(c.is_ascii_alphanumeric() || c == '_'))
        .unwrap_or(rest.len());
    let (name, after) = (&rest[..end], rest[end..].trim_start());
    if after.starts_with('=') {
        return Ok(None); // A constant.
    }
    if name.is_empty() || !name.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_') {
        return Err(format!(
            "expected a field name after {kind:?}, found {rest:?}"
        ));
    }
    let (base, suffix) = match kind.split_once('[') {
        None => (kind, Suffix::One),
        Some((base, count)) => {
            let count = count
                .strip_suffix(']')
                .ok_or_else(|| format!("the type {kind:?} has no closing bracket"))?;
            let suffix = if count.is_empty() || count.starts_with("<=") {
                Suffix::Sequence
            } else {
                Suffix::Array(
                    count
                        .parse()
                        .map_err(|_| format!("the array length in {kind:?} is no number"))?,
                )
            };
            (base, suffix)
        }
    };
    // A bound on a string's length does not change its layout.
    let base = base.split_once("<=").map_or(base, |(base, _)| base);
    Ok(Some(RawField { base, suffix, name }))
}

/// The primitive of a name, if it is one.
fn primitive(name: &str, dialect: Dialect) -> Option<Prim> {
    Some(match name {
        "bool" => Prim::Bool,
        "byte" if dialect == Dialect::Ros1 => Prim::I8,
        "byte" | "char" | "uint8" => Prim::U8,
        "int8" => Prim::I8,
        "int16" => Prim::I16,
        "uint16" => Prim::U16,
        "int32" => Prim::I32,
        "uint32" => Prim::U32,
        "int64" => Prim::I64,
        "uint64" => Prim::U64,
        "float32" => Prim::F32,
        "float64" => Prim::F64,
        _ => return None,
    })
}

fn resolve(
    name: &str,
    owner: &str,
    dialect: Dialect,
    index: &HashMap<String, usize>,
    types: &mut Types,
) -> Result<Type, String> {
    if let Some(prim) = primitive(name, dialect) {
        return Ok(Type::Prim(prim));
    }
    match name {
        "string" => return Ok(Type::Text),
        "wstring" if dialect == Dialect::Ros2 => return Ok(Type::WideText),
        _ => {}
    }
    let package = owner.split('/').next().unwrap_or_default();
    let candidates = if name.contains('/') {
        [short(name), String::new()]
    } else {
        [
            format!("{package}/{name}"),
            if name == "Header" {
                "std_msgs/Header".to_owned()
            } else {
                name.to_owned()
            },
        ]
    };
    for candidate in &candidates {
        if let Some(&position) = index.get(candidate) {
            return Ok(Type::Struct(position));
        }
    }
    // Times are part of the language in ROS 1 and often left out of the text in ROS 2.
    let (seconds, fraction) = match (dialect, candidates[0].as_str(), name) {
        (Dialect::Ros1, _, "time") => (Prim::U32, "nsec"),
        (Dialect::Ros1, _, "duration") => (Prim::I32, "nsec"),
        (Dialect::Ros2, "builtin_interfaces/Time" | "builtin_interfaces/Duration", _)
        | (Dialect::Ros2, _, "time" | "duration") => (Prim::I32, "nanosec"),
        _ => return Err(format!("the type {name} (in {owner}) is not defined")),
    };
    let second = if name == "duration" && dialect == Dialect::Ros1 {
        Prim::I32
    } else {
        Prim::U32
    };
    types.structs.push(Struct {
        name: if name.contains("uration") {
            "builtin_interfaces/Duration"
        } else {
            "builtin_interfaces/Time"
        }
        .to_owned(),
        fields: vec![
            ("sec".to_owned(), Type::Prim(seconds)),
            (fraction.to_owned(), Type::Prim(second)),
        ],
        ..Struct::default()
    });
    Ok(Type::Struct(types.structs.len() - 1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_form_of_a_line_is_understood() {
        let text = "# comment\nint32 X=5\nstring S = \"a # b\"\nstring<=10 name \"x=y\"\nfloat64[9] c\nint8[<=4] s\nHeader header\n\
            Sub[2] subs # trailing\nwstring w\nuint8 v 3\n=====\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n\
            ================================================================================\nMSG: my_pkg/Sub\nbool b\n";
        let types = parse("my_pkg/msg/Top", text, Dialect::Ros2).expect("parses");
        let fields: Vec<String> = types.structs[0]
            .fields
            .iter()
            .map(|(name, kind)| format!("{name}: {kind:?}"))
            .collect();
        assert_eq!(
            fields,
            [
                "name: Text",
                "c: Array(Prim(F64), 9)",
                "s: Sequence(Prim(I8))",
                "header: Struct(1)",
                "subs: Array(Struct(2), 2)",
                "w: WideText",
                "v: Prim(U8)"
            ]
        );
        assert_eq!(types.structs[1].fields[0].1, Type::Struct(3));
    }

    #[test]
    fn what_is_missing_is_named() {
        let error = parse("a/msg/B", "c/D d\n", Dialect::Ros2).expect_err("undefined");
        assert_eq!(error, "the type c/D (in a/B) is not defined");
        let error = parse("a/msg/B", "B b\n", Dialect::Ros2).expect_err("recursive");
        assert_eq!(error, "the type a/B contains itself");
    }
}
