//! Message definitions in OMG IDL (`ros2idl`): modules, structs, typedefs, enums and constants become [`Types`].
//!
//! In a recording the files stand one after the other, each after a line of `=` and a line `IDL: package/msg/Name`.

use std::collections::HashMap;

use super::types::{Extensible, MAX_FIELDS, Prim, Struct, Type, Types};

/// A type as written, its names not yet resolved.
#[derive(Clone, Debug)]
enum Written {
    Prim(Prim),
    Text,
    WideText,
    Name(String),
    Sequence(Box<Written>),
    Array(Box<Written>, usize),
    /// A type that has no layout here, in words: only messages that hold it are refused.
    Unsupported(String),
}

#[derive(Clone, Debug)]
enum Definition {
    Struct {
        base: Option<String>,
        fields: Vec<(String, Written)>,
        extensible: Extensible,
    },
    Alias(Written),
    Enum,
    /// Something that has no layout here, in words.
    Unsupported(String),
}

#[derive(Default)]
struct Definitions {
    by_name: HashMap<String, Definition>,
    /// The constants and enumerators; none where the value is no whole number that is understood.
    constants: HashMap<String, Option<i64>>,
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
        Written::Unsupported(what) => return Err(format!("the type {what:?} has no decoder")),
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
                Definition::Enum => Type::Enum,
                Definition::Unsupported(what) => {
                    return Err(format!("{full} is {what}, which has no decoder"));
                }
                Definition::Alias(inner) => {
                    resolve(inner, inner_scope, definitions, types, known, depth + 1)?
                }
                Definition::Struct {
                    base,
                    fields,
                    extensible,
                } => {
                    let index = types.structs.len();
                    types.structs.push(Struct {
                        name: full.replace("::", "/"),
                        extensible: *extensible,
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
                        types.inherited += all.len();
                        if types.inherited > MAX_FIELDS {
                            return Err(format!(
                                "its structs inherit more than {MAX_FIELDS} fields together"
                            ));
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

/// The full name of `name` as seen from `scope`: the innermost that exists; after a leading `::`, the outermost alone.
fn find(name: &str, scope: &str, exists: impl Fn(&str) -> bool) -> Option<String> {
    if let Some(name) = name.strip_prefix("::") {
        return exists(name).then(|| name.to_owned());
    }
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
        let line_end = || rest.find('\n').map_or(bytes.len(), |end| at + end);
        if line_start
            && (rest.starts_with("===") || rest.starts_with("IDL:") || rest.starts_with('#'))
        {
            at = line_end();
            continue;
        }
        let byte = bytes[at];
        if byte == b'\n' {
            line_start = true;
            at += 1;
        } else if byte.is_ascii_whitespace() {
            at += 1;
        } else if rest.starts_with("//") {
            at = line_end();
        } else if let Some(comment) = rest.strip_prefix("/*") {
            // The star of its beginning is not that of its end.
            at += comment.find("*/").ok_or("a comment has no end")? + 4;
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

const NO_NUMBER: &str = "a size divides by zero or needs more than 64 bits";

/// A number as IDL writes it: decimal, hexadecimal (`0x1F`) or octal (`017`).
fn whole_number(token: &str) -> Option<i64> {
    let (digits, base) = match token.strip_prefix("0x").or(token.strip_prefix("0X")) {
        Some(digits) => (digits, 16),
        None if token.starts_with('0') => (token, 8),
        None => (token, 10),
    };
    i64::from_str_radix(digits, base).ok()
}

/// An annotation's name and what stands in parentheses behind it.
type Annotation<'a> = (&'a str, &'a [&'a str]);

/// Whether annotations give a type this extensibility: `@mutable`, or as `@extensibility(MUTABLE)`.
fn are_of(annotations: &[Annotation<'_>], extensibility: &str) -> bool {
    annotations.iter().any(|(name, said)| {
        name.eq_ignore_ascii_case(extensibility)
            || (name.eq_ignore_ascii_case("extensibility")
                && said
                    .iter()
                    .any(|word| word.to_lowercase().starts_with(extensibility)))
    })
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

    /// Reads annotations: `@name` and what stands in parentheses behind it.
    fn annotations(&mut self) -> Vec<Annotation<'a>> {
        let mut annotations = Vec::new();
        while self.peek() == "@" {
            self.at += 1;
            let name = self.next();
            let start = self.at;
            self.nested("(", ")");
            let said = self.tokens.get(start..self.at).unwrap_or_default();
            annotations.push((name, said));
        }
        annotations
    }

    fn definition(&mut self, depth: usize) -> Result<(), String> {
        if depth > 64 {
            return Err("modules are nested more than 64 deep".to_owned());
        }
        let annotations = self.annotations();
        if matches!(annotations.last(), Some(("annotation", []))) {
            // One is defined here.
            self.skip_braces();
            return Ok(());
        }
        match self.next() {
            // The latter stand before `interface` and `valuetype`.
            "" | ";" | "abstract" | "local" => {}
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
            "struct" => self.structure(&annotations)?,
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
                // Not every constant is a whole number; one that is a size and is none is refused there.
                let start = self.at;
                let value = self.expression(0).ok().filter(|_| self.peek() == ";");
                self.found.constants.insert(self.full(name), value);
                self.at = start;
                while self.at < self.tokens.len() && self.next() != ";" {}
            }
            "enum" => {
                let name = self.next();
                let bound = annotations
                    .iter()
                    .find(|(name, _)| name.eq_ignore_ascii_case("bit_bound"))
                    .map(|(_, said)| said.concat());
                let definition = match bound {
                    Some(bound) if bound != "(32)" => {
                        Definition::Unsupported(format!("an enum with @bit_bound{bound}"))
                    }
                    _ => Definition::Enum,
                };
                self.found.by_name.insert(self.full(name), definition);
                self.enumerators();
            }
            word @ ("union" | "bitmask" | "bitset" | "native" | "exception" | "interface"
            | "valuetype") => {
                let name = self.next();
                let article = if word.starts_with(['e', 'i']) {
                    "an"
                } else {
                    "a"
                };
                self.found.by_name.insert(
                    self.full(name),
                    Definition::Unsupported(format!("{article} {word}")),
                );
                self.skip_braces();
            }
            other => return Err(format!("expected a definition, found {other:?}")),
        }
        Ok(())
    }

    /// The enumerators of an enum, constants in the scope around it: counted from 0, or from where `@value` says.
    fn enumerators(&mut self) {
        if self.peek() != "{" {
            return self.skip_braces();
        }
        self.at += 1;
        let mut value = Some(0);
        while self.at < self.tokens.len() && self.peek() != "}" {
            for (name, said) in self.annotations() {
                if name.eq_ignore_ascii_case("value") {
                    let said = said.concat();
                    value = whole_number(said.trim_matches(['(', ')']));
                }
            }
            let name = self.next();
            self.found.constants.insert(self.full(name), value);
            value = value.and_then(|value| value.checked_add(1));
            while self.at < self.tokens.len() && !matches!(self.peek(), "," | "}") {
                // What else stands there is not known, nor what it means for the values.
                value = None;
                self.at += 1;
            }
            if self.peek() == "," {
                self.at += 1;
            }
        }
        self.at += 1;
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

    fn structure(&mut self, annotations: &[Annotation<'_>]) -> Result<(), String> {
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
        // Mutable structs are parameter lists, wherever they stand; a flag stands before members that may be missing.
        let mut unsupported =
            are_of(annotations, "mutable").then(|| "a @mutable struct".to_owned());
        while self.peek() != "}" {
            if self.at >= self.tokens.len() {
                return Err(format!("the struct {name} has no closing brace"));
            }
            let optional = self.annotations().iter().any(|(name, said)| {
                name.eq_ignore_ascii_case("optional")
                    && !said.iter().any(|word| word.eq_ignore_ascii_case("false"))
            });
            let kind = self
                .kind(0)
                .map_err(|problem| format!("in struct {name}: {problem}"))?;
            loop {
                let (field, kind) = self.declarator(&kind)?;
                if optional && unsupported.is_none() {
                    unsupported = Some(format!("a struct with the @optional member {field}"));
                }
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
        let definition = match unsupported {
            Some(what) => Definition::Unsupported(what),
            None => Definition::Struct {
                base,
                fields,
                extensible: match () {
                    () if are_of(annotations, "final") => Extensible::No,
                    () if are_of(annotations, "appendable") => Extensible::Yes,
                    () => Extensible::Unsaid,
                },
            },
        };
        self.found.by_name.insert(self.full(name), definition);
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

    /// The size of an array.
    fn size(&mut self) -> Result<usize, String> {
        let size = self.expression(0)?;
        usize::try_from(size)
            .map_err(|_| format!("an array has the size {size}; expected 0 or more"))
    }

    /// A whole number made of numbers, constants, `+ - * /` and parentheses.
    fn expression(&mut self, depth: usize) -> Result<i64, String> {
        let mut sum = self.product(depth)?;
        while matches!(self.peek(), "+" | "-") {
            let plus = self.next() == "+";
            let next = self.product(depth)?;
            sum = if plus {
                sum.checked_add(next)
            } else {
                sum.checked_sub(next)
            }
            .ok_or(NO_NUMBER)?;
        }
        Ok(sum)
    }

    fn product(&mut self, depth: usize) -> Result<i64, String> {
        let mut product = self.operand(depth)?;
        while matches!(self.peek(), "*" | "/") {
            let times = self.next() == "*";
            let next = self.operand(depth)?;
            product = if times {
                product.checked_mul(next)
            } else {
                product.checked_div(next)
            }
            .ok_or(NO_NUMBER)?;
        }
        Ok(product)
    }

    fn operand(&mut self, depth: usize) -> Result<i64, String> {
        if depth > 64 {
            return Err("an expression is nested more than 64 deep".to_owned());
        }
        let token = self.next();
        match token {
            "-" => return Ok(self.operand(depth + 1)?.checked_neg().ok_or(NO_NUMBER)?),
            "+" => return self.operand(depth + 1),
            "(" => {
                let value = self.expression(depth + 1)?;
                self.expect(")")?;
                return Ok(value);
            }
            _ => {}
        }
        if let Some(value) = whole_number(token) {
            return Ok(value);
        }
        let constants = &self.found.constants;
        match find(token, &self.scope.join("::"), |name| {
            constants.contains_key(name)
        })
        .and_then(|name| constants.get(&name))
        {
            Some(Some(value)) => Ok(*value),
            Some(None) => Err(format!(
                "the value of the constant {token} is no whole number made with + - * /"
            )),
            None => Err(format!(
                "the size {token:?} is neither a number nor a constant"
            )),
        }
    }

    /// Steps over what stands between brackets, which may hold further ones, if one opens here.
    fn nested(&mut self, open: &str, close: &str) {
        if self.peek() != open {
            return;
        }
        let mut depth = 0;
        while self.at < self.tokens.len() {
            let token = self.next();
            depth += i32::from(token == open) - i32::from(token == close);
            if depth == 0 {
                return;
            }
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
                    _ => return Ok(Written::Unsupported(words.join(" "))),
                }
            }
            "string" => {
                self.nested("<", ">");
                return Ok(Written::Text);
            }
            "wstring" => {
                self.nested("<", ">");
                return Ok(Written::WideText);
            }
            "sequence" => {
                self.expect("<")?;
                let inner = self.kind(depth + 1)?;
                // The bound, a number or an expression, changes nothing.
                if self.peek() == "," {
                    while self.at < self.tokens.len() && self.peek() != ">" {
                        self.at += 1;
                    }
                }
                self.expect(">")?;
                return Ok(Written::Sequence(Box::new(inner)));
            }
            "wchar" | "map" | "fixed" | "any" => {
                self.nested("<", ">");
                return Ok(Written::Unsupported(token.to_owned()));
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
        assert_eq!(types.structs[1].fields[0].1, Type::Enum);
    }

    #[test]
    fn what_moves_numbers_and_is_not_read_is_refused() {
        let problem = |text: &str| parse("p/M", &format!("module p {{ {text} }};")).err();
        for (text, expected) in [
            (
                "struct M { long a; @optional double b; double c; };",
                "p::M is a struct with the @optional member b, which has no decoder",
            ),
            (
                "struct In { @key @optional(TRUE) long a, b; }; struct M { sequence<In> x; };",
                "p::In is a struct with the @optional member a, which has no decoder",
            ),
            (
                "@bit_bound(16) enum E { A, B }; struct M { E e; };",
                "p::E is an enum with @bit_bound(16), which has no decoder",
            ),
            (
                "@mutable struct M { long a; };",
                "p::M is a @mutable struct, which has no decoder",
            ),
            (
                "@extensibility(MUTABLE) struct In { long a; }; struct M : In { long b; };",
                "p::In is a @mutable struct, which has no decoder",
            ),
            (
                "union U switch (long) { case 1: long a; }; struct M { U u; };",
                "p::U is a union, which has no decoder",
            ),
            (
                "interface I { void f(in long a); }; struct M { sequence<I> x; };",
                "p::I is an interface, which has no decoder",
            ),
            (
                "struct M { map<string, sequence<long, 2>> x; };",
                "the type \"map\" has no decoder",
            ),
        ] {
            assert_eq!(problem(text).as_deref(), Some(expected));
        }
        // Not of this message, or without effect on where numbers lie.
        for text in [
            "@mutable struct Other { @optional long a; }; struct M { long a; };",
            "native N; exception X { long c; }; abstract interface I; local interface I { struct S { long a; }; }; struct M { long a; };",
            "@annotation foo { string v default \"x\"; }; @foo(v=\"y\") struct M { long a; };",
            "struct Other { map<string, sequence<long, 2>> m; wchar w; fixed<5, 2> f; long double d; any a; }; struct M { long a; };",
            "@final @bit_bound(32) enum E { A }; @nested struct M { @optional(FALSE) E e; @key @id(3) long b; };",
        ] {
            assert_eq!(problem(text), None, "{text}");
        }
        let extensible = |text: &str| parse("p/M", text).expect("parses").structs[0].extensible;
        for (annotation, expected) in [
            ("", Extensible::Unsaid),
            ("@final", Extensible::No),
            ("@appendable", Extensible::Yes),
            ("@extensibility(APPENDABLE)", Extensible::Yes),
        ] {
            let text = format!("module p {{ {annotation} struct M {{ long a; }}; }};");
            assert_eq!(extensible(&text), expected, "{text}");
        }
    }

    #[test]
    fn a_leading_colon_is_the_root() {
        let text = "module b { struct X { long v; long u; }; const long N = 2; };
            module a { module b { struct X { double v; }; const long N = 7; };
            struct Y { b::X x; ::b::X z; long n[b::N]; long m[::b::N]; }; };";
        let types = parse("a/Y", text).expect("parses");
        let names: Vec<&str> = types.structs.iter().map(|s| s.name.as_str()).collect();
        assert_eq!(names, ["a/Y", "a/b/X", "b/X"]);
        let long = Box::new(Type::Prim(Prim::I32));
        let [_, z, n, m] = &types.structs[0].fields[..] else {
            panic!("four fields");
        };
        assert_eq!(z.1, Type::Struct(2));
        assert_eq!(n.1, Type::Array(long.clone(), 7));
        assert_eq!(m.1, Type::Array(long, 2));
        let missing = parse(
            "a/Y",
            "module a { struct X { long v; }; struct Y { ::X x; }; };",
        );
        assert_eq!(
            missing.err().as_deref(),
            Some("the type ::X is not defined")
        );
    }

    #[test]
    fn a_comment_does_not_end_where_it_begins() {
        let text = "struct M { long a; /*/ long x; /*/ long b; /**/ long c; };";
        assert_eq!(parse("M", text).expect("parses").structs[0].fields.len(), 3);
    }

    #[test]
    fn sizes_are_worked_out() {
        let size = |constants: &str, size: &str| {
            let text = format!("{constants} struct M {{ octet a[{size}]; }};");
            parse("M", &text).map(|types| match types.structs[0].fields[0].1 {
                Type::Array(_, size) => size,
                _ => 0,
            })
        };
        let n = "const unsigned long N = 2 * 3; const long M_ = N; const long K = -(M_ - 010) * (0x10 + 2) / 4;";
        assert_eq!(size(n, "N"), Ok(6));
        assert_eq!(size(n, "M_"), Ok(6));
        assert_eq!(size(n, "K"), Ok(9));
        assert_eq!(size(n, "N + 2 * ::N - 1"), Ok(17));
        let e = "enum E { A, @value(0x10) B, COUNT, @default_literal LAST };";
        assert_eq!(size(e, "COUNT"), Ok(17));
        assert_eq!(size(e, "A + LAST"), Ok(18));
        let f = "const float F = 1.5; const long S = 1 << 3; const string T = \"a;b\";";
        assert_eq!(size(f, "3"), Ok(3));
        for (constants, given, expected) in [
            (
                f,
                "F",
                "the value of the constant F is no whole number made with + - * /",
            ),
            (
                f,
                "S",
                "the value of the constant S is no whole number made with + - * /",
            ),
            ("", "Q", "the size \"Q\" is neither a number nor a constant"),
            ("", "1 - 2", "an array has the size -1; expected 0 or more"),
            (
                "",
                "1 / 0",
                "a size divides by zero or needs more than 64 bits",
            ),
        ] {
            assert_eq!(size(constants, given), Err(expected.to_owned()));
        }
    }
}
