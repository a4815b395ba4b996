//! Message definitions in OMG IDL (`ros2idl`): modules, structs, typedefs, enums and constants become [`Types`].
//!
//! In a recording the files stand one after the other, each after a line of `=` and a line `IDL: package/msg/Name`.

use std::collections::HashMap;

use super::types::{Prim, Struct, Type, Types};

/// A type as written, its names not yet resolved.
#[derive(Clone, Debug)]
enum Written {
    Prim(Prim),
    Text,
    WideText,
    Name(String),
    Sequence(Box<Written>),
    Array(Box<Written>, usize),
}

#[derive(Clone, Debug)]
enum Definition {
    Struct {
        base: Option<String>,
        fields: Vec<(String, Written)>,
    },
    Alias(Written),
    Enum,
    /// Something that has no layout here, by its keyword.
    Unsupported(&'static str),
}

#[derive(Default)]
struct Definitions {
    by_name: HashMap<String, Definition>,
    constants: HashMap<String, usize>,
}

/// Parses the definition of message `name` (`package/msg/Name` or `package::msg::Name`).
pub(super) fn parse(name: &str, text: &str) -> Result<Types, String> {
    let tokens = tokens(text)?;
    let mut parser = Parser {
        tokens: &tokens,
        at: 0,
        scope: Vec::new(),
        found: Definitions::default(),
    };
    while parser.at < parser.tokens.len() {
        parser.definition(0)?;
    }
    let definitions = parser.found;
    let root = name.replace('/', "::");
    let mut types = Types::default();
    let mut known = HashMap::new();
    let kind = resolve(
        &Written::Name(root.clone()),
        "",
        &definitions,
        &mut types,
        &mut known,
        0,
    )?;
    if kind != Type::Struct(0) {
        return Err(format!("{root} is not a struct"));
    }
    types.check_finite()?;
    Ok(types)
}

fn resolve(
    written: &Written,
    scope: &str,
    definitions: &Definitions,
    types: &mut Types,
    known: &mut HashMap<String, usize>,
    depth: usize,
) -> Result<Type, String> {
    if depth > 64 {
        return Err("types are nested more than 64 deep".to_owned());
    }
    Ok(match written {
        Written::Prim(prim) => Type::Prim(*prim),
        Written::Text => Type::Text,
        Written::WideText => Type::WideText,
        Written::Sequence(inner) => Type::Sequence(Box::new(resolve(
            inner,
            scope,
            definitions,
            types,
            known,
            depth + 1,
        )?)),
        Written::Array(inner, count) => Type::Array(
            Box::new(resolve(inner, scope, definitions, types, known, depth + 1)?),
            *count,
        ),
        Written::Name(name) => {
            let full = find(name, scope, |candidate| {
                definitions.by_name.contains_key(candidate)
            });
            let Some((full, definition)) =
                full.and_then(|full| definitions.by_name.get(&full).map(|found| (full, found)))
            else {
                return Err(format!("the type {name} is not defined"));
            };
            if let Some(&index) = known.get(&full) {
                return Ok(Type::Struct(index));
            }
            let inner_scope = full.rsplit_once("::").map_or("", |(scope, _)| scope);
            match definition {
                Definition::Enum => Type::Prim(Prim::U32),
                Definition::Unsupported(what) => {
                    return Err(format!("{full} is a {what}, which has no decoder"));
                }
                Definition::Alias(inner) => {
                    resolve(inner, inner_scope, definitions, types, known, depth + 1)?
                }
                Definition::Struct { base, fields } => {
                    let index = types.structs.len();
                    types.structs.push(Struct {
                        name: full.replace("::", "/"),
                        fields: Vec::new(),
                    });
                    known.insert(full.clone(), index);
                    let mut all = Vec::new();
                    if let Some(base) = base {
                        let kind = resolve(
                            &Written::Name(base.clone()),
                            inner_scope,
                            definitions,
                            types,
                            known,
                            depth + 1,
                        )?;
                        if let Type::Struct(base) = kind {
                            all.extend(types.structs[base].fields.clone());
                        }
                    }
                    for (name, field) in fields {
                        all.push((
                            name.clone(),
                            resolve(field, inner_scope, definitions, types, known, depth + 1)?,
                        ));
                    }
                    types.structs[index].fields = all;
                    Type::Struct(index)
                }
            }
        }
    })
}

/// The full name of `name` as seen from `scope`: the innermost that exists.
fn find(name: &str, scope: &str, exists: impl Fn(&str) -> bool) -> Option<String> {
    let name = name.trim_start_matches("::");
    let mut scope = scope;
    loop {
        let candidate = if scope.is_empty() {
            name.to_owned()
        } else {
            format!("{scope}::{name}")
        };
        if exists(&candidate) {
            return Some(candidate);
        }
        if scope.is_empty() {
            return None;
        }
        scope = scope.rsplit_once("::").map_or("", |(outer, _)| outer);
    }
}

/// Splits the text into words and signs; comments, preprocessor lines and the lines between files fall away.
fn tokens(text: &str) -> Result<Vec<&str>, String> {
    let bytes = text.as_bytes();
    let mut tokens = Vec::new();
    let mut at = 0;
    let mut line_start = true;
    while at < bytes.len() {
        let rest = &text[at..];
        let line_end = rest.find('\n').map_or(bytes.len(), |end| at + end);
        if line_start
            && (rest.starts_with("===") || rest.starts_with("IDL:") || rest.starts_with('#'))
        {
            at = line_end;
            continue;
        }
        let byte = bytes[at];
        if byte == b'\n' {
            line_start = true;
            at += 1;
        } else if byte.is_ascii_whitespace() {
            at += 1;
        } else if rest.starts_with("//") {
            at = line_end;
        } else if rest.starts_with("/*") {
            at += rest.find("*/").ok_or("a comment has no end")? + 2;
        } else if byte == b'"' || byte == b'\'' {
            let mut end = at + 1;
            while end < bytes.len() && bytes[end] != byte {
                end += if bytes[end] == b'\\' { 2 } else { 1 };
            }
            if end >= bytes.len() {
                return Err("a text in quotes has no end".to_owned());
            }
            tokens.push(&text[at..=end]);
            at = end + 1;
            line_start = false;
        } else if byte.is_ascii_alphanumeric() || byte == b'_' || rest.starts_with("::") {
            let mut end = at;
            while end < bytes.len()
                && (bytes[end].is_ascii_alphanumeric()
                    || matches!(bytes[end], b'_' | b'.')
                    || text[end..].starts_with("::"))
            {
                end += if bytes[end] == b':' { 2 } else { 1 };
            }
            tokens.push(&text[at..end]);
            at = end;
            line_start = false;
        } else {
            let width = rest.chars().next().map_or(1, char::len_utf8);
            tokens.push(&text[at..at + width]);
            at += width;
            line_start = false;
        }
    }
    Ok(tokens)
}

struct Parser<'a> {
    tokens: &'a [&'a str],
    at: usize,
    scope: Vec<String>,
    found: Definitions,
}

impl<'a> Parser<'a> {
    fn peek(&self) -> &'a str {
        self.tokens.get(self.at).copied().unwrap_or("")
    }

    fn next(&mut self) -> &'a str {
        let token = self.peek();
        self.at += 1;
        token
    }

    fn expect(&mut self, wanted: &str) -> Result<(), String> {
        let token = self.next();
        if token == wanted {
            Ok(())
        } else {
            Err(format!("expected {wanted:?}, found {token:?}"))
        }
    }

    fn full(&self, name: &str) -> String {
        if self.scope.is_empty() {
            name.to_owned()
        } else {
            format!("{}::{name}", self.scope.join("::"))
        }
    }

    /// Steps over annotations: `@name` and what stands in parentheses behind it.
    fn annotations(&mut self) {
        while self.peek() == "@" {
            self.at += 2;
            if self.peek() == "(" {
                let mut depth = 0;
                while self.at < self.tokens.len() {
                    match self.next() {
                        "(" => depth += 1,
                        ")" => depth -= 1,
                        _ => {}
                    }
                    if depth == 0 {
                        break;
                    }
                }
            }
        }
    }

    fn definition(&mut self, depth: usize) -> Result<(), String> {
        if depth > 64 {
            return Err("modules are nested more than 64 deep".to_owned());
        }
        self.annotations();
        match self.next() {
            "" | ";" => {}
            "module" => {
                let name = self.next().to_owned();
                self.scope.push(name);
                self.expect("{")?;
                while self.peek() != "}" {
                    if self.at >= self.tokens.len() {
                        return Err("a module has no closing brace".to_owned());
                    }
                    self.definition(depth + 1)?;
                }
                self.at += 1;
                self.scope.pop();
            }
            "struct" => self.structure()?,
            "typedef" => {
                let kind = self.kind(0)?;
                loop {
                    let (name, kind) = self.declarator(&kind)?;
                    self.found
                        .by_name
                        .insert(self.full(&name), Definition::Alias(kind));
                    if self.peek() != "," {
                        break;
                    }
                    self.at += 1;
                }
                self.expect(";")?;
            }
            "const" => {
                self.kind(0)?;
                let name = self.next();
                self.expect("=")?;
                if let Ok(value) = self.peek().parse() {
                    self.found.constants.insert(self.full(name), value);
                }
                while self.at < self.tokens.len() && self.next() != ";" {}
            }
            "enum" => {
                let name = self.next();
                self.found.by_name.insert(self.full(name), Definition::Enum);
                self.skip_braces();
            }
            word @ ("union" | "bitmask" | "bitset") => {
                let what = match word {
                    "union" => "union",
                    "bitmask" => "bitmask",
                    _ => "bitset",
                };
                let name = self.next();
                self.found
                    .by_name
                    .insert(self.full(name), Definition::Unsupported(what));
                self.skip_braces();
            }
            other => return Err(format!("expected a definition, found {other:?}")),
        }
        Ok(())
    }

    /// Steps over everything up to the end of the next block in braces.
    fn skip_braces(&mut self) {
        let mut depth = 0;
        while self.at < self.tokens.len() {
            match self.next() {
                "{" => depth += 1,
                "}" => {
                    depth -= 1;
                    if depth == 0 {
                        return;
                    }
                }
                ";" if depth == 0 => return,
                _ => {}
            }
        }
    }

    fn structure(&mut self) -> Result<(), String> {
        let name = self.next();
        if self.peek() == ";" {
            return Ok(()); // Announced, defined elsewhere.
        }
        let mut base = None;
        if self.peek() == ":" {
            self.at += 1;
            base = Some(self.next().to_owned());
        }
        self.expect("{")?;
        let mut fields = Vec::new();
        while self.peek() != "}" {
            if self.at >= self.tokens.len() {
                return Err(format!("the struct {name} has no closing brace"));
            }
            self.annotations();
            let kind = self
                .kind(0)
                .map_err(|problem| format!("in struct {name}: {problem}"))?;
            loop {
                let (field, kind) = self.declarator(&kind)?;
                fields.push((field, kind));
                if self.peek() != "," {
                    break;
                }
                self.at += 1;
            }
            self.expect(";")?;
        }
        self.at += 1;
        // The byte that ROS 2 puts into empty structs is what our layout gives an empty struct.
        if let [(field, _)] = fields.as_slice()
            && field == "structure_needs_at_least_one_member"
        {
            fields.clear();
        }
        self.found
            .by_name
            .insert(self.full(name), Definition::Struct { base, fields });
        Ok(())
    }

    /// A name with array dimensions behind it.
    fn declarator(&mut self, kind: &Written) -> Result<(String, Written), String> {
        let name = self.next().to_owned();
        let mut sizes = Vec::new();
        while self.peek() == "[" {
            self.at += 1;
            sizes.push(self.size()?);
            self.expect("]")?;
        }
        let kind = sizes.iter().rev().fold(kind.clone(), |inner, &size| {
            Written::Array(Box::new(inner), size)
        });
        Ok((name, kind))
    }

    /// A number or the name of a constant.
    fn size(&mut self) -> Result<usize, String> {
        let token = self.next();
        if let Ok(size) = token.parse() {
            return Ok(size);
        }
        let constants = &self.found.constants;
        find(token, &self.scope.join("::"), |name| {
            constants.contains_key(name)
        })
        .and_then(|name| constants.get(&name).copied())
        .ok_or_else(|| format!("the size {token:?} is neither a number nor a constant"))
    }

    /// Steps over `<bound>`.
    fn bound(&mut self) {
        if self.peek() == "<" {
            while self.at < self.tokens.len() && self.next() != ">" {}
        }
    }

    fn kind(&mut self, depth: usize) -> Result<Written, String> {
        if depth > 64 {
            return Err("types are nested more than 64 deep".to_owned());
        }
        self.annotations();
        let token = self.next();
        Ok(Written::Prim(match token {
            "boolean" => Prim::Bool,
            "octet" | "uint8" | "char" => Prim::U8,
            "int8" => Prim::I8,
            "short" | "int16" => Prim::I16,
            "uint16" => Prim::U16,
            "int32" => Prim::I32,
            "uint32" => Prim::U32,
            "int64" => Prim::I64,
            "uint64" => Prim::U64,
            "float" => Prim::F32,
            "double" => Prim::F64,
            "unsigned" | "long" => {
                let signed = token == "long";
                let mut words = vec![token];
                while matches!(self.peek(), "long" | "short" | "double") {
                    words.push(self.next());
                }
                match (signed, words.as_slice()) {
                    (true, ["long"]) => Prim::I32,
                    (true, ["long", "long"]) => Prim::I64,
                    (false, ["unsigned", "short"]) => Prim::U16,
                    (false, ["unsigned", "long"]) => Prim::U32,
                    (false, ["unsigned", "long", "long"]) => Prim::U64,
                    _ => return Err(format!("the type {:?} has no decoder", words.join(" "))),
                }
            }
            "string" => {
                self.bound();
                return Ok(Written::Text);
            }
            "wstring" => {
                self.bound();
                return Ok(Written::WideText);
            }
            "sequence" => {
                self.expect("<")?;
                let inner = self.kind(depth + 1)?;
                if self.peek() == "," {
                    self.at += 2;
                }
                self.expect(">")?;
                return Ok(Written::Sequence(Box::new(inner)));
            }
            "wchar" | "map" | "fixed" | "any" => {
                return Err(format!("the type {token:?} has no decoder"));
            }
            name if name.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_' || c == ':') => {
                return Ok(Written::Name(name.to_owned()));
            }
            other => return Err(format!("expected a type, found {other:?}")),
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_files_that_ros_generates_are_understood() {
        let text = "IDL: a/msg/Top\n// generated\n#include \"b/msg/Part.idl\"\n\nmodule a {\n module msg {\n  module Top_Constants {\n   \
            const int32 X = 3;\n  };\n  typedef double double__9[9];\n  @verbatim (language=\"comment\", text=\n   \"hello (world)\" \"more\")\n  \
            struct Top {\n   b::msg::Part part;\n   @unit (value=\"m\") double__9 cov;\n   sequence<float, 4> s;\n   string<10> t;\n   \
            unsigned long long big;\n   b::msg::Part many[2];\n  };\n };\n};\n\
            ================================================================================\nIDL: b/msg/Part\nmodule b { module msg {\n \
            enum Color { RED, GREEN };\n struct Part { Color color; boolean flag; };\n}; };\n";
        let types = parse("a/msg/Top", text).expect("parses");
        let fields: Vec<String> = types.structs[0]
            .fields
            .iter()
            .map(|(name, kind)| format!("{name}: {kind:?}"))
            .collect();
        assert_eq!(
            fields,
            [
                "part: Struct(1)",
                "cov: Array(Prim(F64), 9)",
                "s: Sequence(Prim(F32))",
                "t: Text",
                "big: Prim(U64)",
                "many: Array(Struct(1), 2)"
            ]
        );
        assert_eq!(types.structs[1].fields[0].1, Type::Prim(Prim::U32));
    }
}
