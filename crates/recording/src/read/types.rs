//! Message types as schemas of ROS 1, ROS 2 and IDL define them: what the layout compiler works from.

/// A number of fixed size.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Prim {
    /// One byte, 0 or 1.
    Bool,
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

impl Prim {
    /// Size in bytes, which is also its alignment in XCDR1.
    pub fn size(self) -> usize {
        match self {
            Prim::Bool | Prim::I8 | Prim::U8 => 1,
            Prim::I16 | Prim::U16 => 2,
            Prim::I32 | Prim::U32 | Prim::F32 => 4,
            Prim::I64 | Prim::U64 | Prim::F64 => 8,
        }
    }
}

/// The type of a field.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Type {
    Prim(Prim),
    /// A `u32` on the wire.
    Enum,
    Text,
    WideText,
    /// Index into [`Types::structs`].
    Struct(usize),
    Array(Box<Type>, usize),
    Sequence(Box<Type>),
}

impl Type {
    /// What a collection is of: of an array of arrays, which is one of several dimensions, what those are of.
    pub fn item(&self) -> &Type {
        match self {
            Type::Array(inner, _) if matches!(**inner, Type::Array(..)) => inner.item(),
            Type::Array(inner, _) | Type::Sequence(inner) => inner,
            _ => self,
        }
    }

    /// The number that it is on the wire, if it is one.
    pub fn prim(&self) -> Option<Prim> {
        match self {
            Type::Prim(prim) => Some(*prim),
            Type::Enum => Some(Prim::U32),
            _ => None,
        }
    }
}

/// Whether a struct may get further fields, for which XCDR2 puts its size before it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Extensible {
    No,
    /// By the standard it may; writers differ.
    #[default]
    Unsaid,
    Yes,
}

/// A message type.
#[derive(Clone, Debug, Default)]
pub(super) struct Struct {
    pub name: String,
    pub extensible: Extensible,
    pub fields: Vec<(String, Type)>,
}

/// All types of a schema; the first struct is the message.
#[derive(Clone, Debug, Default)]
pub(super) struct Types {
    pub structs: Vec<Struct>,
    /// Fields that structs have from those that they inherit from, copies of copies included.
    pub inherited: usize,
}

/// More fields than this in one message type are refused: a schema could otherwise multiply arrays of arrays, or what is inherited, without end.
pub(super) const MAX_FIELDS: usize = 100_000;

impl Types {
    /// Refuses types that contain themselves: no message of such a type is finite.
    pub fn check_finite(&self) -> Result<(), String> {
        // 0 unseen, 1 on the way, 2 done.
        let mut state = vec![0u8; self.structs.len()];
        self.visit(0, &mut state, 0)
    }

    fn visit(&self, index: usize, state: &mut [u8], depth: usize) -> Result<(), String> {
        if state[index] == 2 {
            return Ok(());
        }
        if state[index] == 1 {
            return Err(format!(
                "the type {} contains itself",
                self.structs[index].name
            ));
        }
        if depth > 64 {
            return Err("types are nested more than 64 deep".to_owned());
        }
        state[index] = 1;
        for (_, kind) in &self.structs[index].fields {
            let mut kind = kind;
            while let Type::Array(inner, _) | Type::Sequence(inner) = kind {
                kind = inner;
            }
            if let Type::Struct(inner) = kind {
                self.visit(*inner, state, depth + 1)?;
            }
        }
        state[index] = 2;
        Ok(())
    }
}
