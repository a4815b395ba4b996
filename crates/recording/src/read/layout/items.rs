//! The items of sequences and arrays: each place, or each name, has a program of its own, and those left out are stepped over.

use std::{collections::HashMap, fmt};

use super::super::{
    names,
    rows::{Long, Rows},
    types::{Prim, Type, Types},
};
use super::{
    Context, Fail, OTHER_SIZE, Op, Program, TOO_MANY, align, compile, end_of, other, short,
};

/// The items of a sequence or array.
#[derive(Clone, Debug)]
pub(super) struct Items {
    pub field: String,
    kind: Type,
    /// Size of an item that is a number; such items are skipped without being looked at.
    prim: Option<Prim>,
    header: bool,
    /// Whether they are those of an array, not of a sequence.
    part: bool,
    /// Whether they become signals, as those of items that are left out do not.
    take: bool,
    /// What they are called by.
    called: Names,
    /// Programs of the items seen so far: by their place, or where labels say.
    programs: Vec<Program>,
    labels: HashMap<Label, usize>,
}

/// What one item is called, where items are called by name.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
enum Label {
    Name(Box<[u8]>),
    /// One without a name.
    Place(usize),
}

impl fmt::Display for Label {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Label::Name(name) => f.write_str(&String::from_utf8_lossy(name)),
            Label::Place(place) => place.fmt(f),
        }
    }
}

/// What the items of a list are called by, beside their place.
#[derive(Clone, Debug)]
pub(super) enum Names {
    None,
    /// By a text in the item: the number of the list, and what leads up to the text, once it was needed.
    Own {
        list: usize,
        field: String,
        head: Option<Program>,
    },
    /// They are names themselves, of lists behind this one: its number.
    Of(usize),
    /// By those of a list before this one.
    Beside,
}

impl Items {
    /// Items of a type: whether they become signals, begin with their size, and are those of an array.
    pub fn new(
        types: &Types,
        rows: &mut Rows,
        inner: &Type,
        (take, header, part): (bool, bool, bool),
        field: &str,
    ) -> Self {
        let called = match inner {
            Type::Struct(index) if take => {
                let fields = types.structs[*index].fields.iter();
                let texts = fields.filter(|(_, kind)| *kind == Type::Text);
                match names::of_item(texts.map(|(name, _)| name.as_str())) {
                    Some(name) => Names::Own {
                        list: rows.names.list(field),
                        field: name.to_owned(),
                        head: None,
                    },
                    None => Names::None,
                }
            }
            _ => Names::None,
        };
        Items {
            called,
            labels: HashMap::new(),
            field: field.to_owned(),
            kind: inner.clone(),
            prim: inner.prim(),
            header,
            part,
            take,
            programs: Vec::new(),
        }
    }

    /// What the field beside them says that they are called by: texts name others, numbers are named.
    pub fn call(&mut self, names: Names) {
        match names {
            Names::Beside if self.prim.is_none() => {}
            Names::None => {}
            names => self.called = names,
        }
    }

    /// Where the items end, if XCDR2 put their size before them, and where they begin.
    pub fn header(
        &self,
        context: &mut Context<'_>,
        at: usize,
    ) -> Result<(Option<usize>, usize), Fail> {
        if !self.header {
            return Ok((None, at));
        }
        let (size, at) = context.length(at, &self.field)?;
        Ok((Some(at.saturating_add(size)), at))
    }

    /// Whether the items ended at `at`, where their size said.
    pub fn check(&self, end: Option<usize>, at: usize) -> Result<usize, Fail> {
        match end {
            Some(end) if end != at => Err(other(at, &self.field, OTHER_SIZE)),
            _ => Ok(at),
        }
    }

    /// Reads so many items from `at` on, and says where they end.
    pub fn read(
        &mut self,
        context: &mut Context<'_>,
        mut at: usize,
        count: usize,
        rows: &mut Rows,
    ) -> Result<usize, Fail> {
        let fits = count <= rows.max_items;
        let mut taken = 0;
        if let Names::Of(_) = self.called {
            context.names.clear();
        }
        while self.take && fits && taken < count {
            let label = self.label(context, at, taken, rows)?;
            let place = match &label {
                Some(label) => self.labels.get(label).copied(),
                None => Some(taken),
            };
            let place = place.unwrap_or(self.programs.len());
            let room = match self.programs.get(place) {
                Some(program) => rows.enter(program.places),
                // Without any room nothing has to be compiled to be refused.
                None if !rows.has_room(1) => rows.enter(1),
                None => {
                    let label = label.unwrap_or(Label::Place(taken));
                    let (types, field) = (context.types, format!("{}[{label}]", self.field));
                    let how = (true, self.part);
                    let program = compile(types, &self.kind, &field, context.shape, rows, how)
                        .map_err(|_| other(at, &self.field, TOO_MANY))?;
                    let room = rows.enter(program.places);
                    if room {
                        rows.places += program.places;
                        self.programs.push(program);
                        if rows.by_name {
                            self.labels.insert(label, place);
                        }
                    }
                    room
                }
            };
            if !room {
                break;
            }
            at = self.programs[place].run(context, at, rows)?;
            taken += 1;
        }
        if taken == count {
            return Ok(at);
        }
        if self.take && !fits {
            rows.note_long(Long::Items(self.field.clone()));
        }
        // The flat table does not count what is left out.
        context.trace = None;
        self.skip(context, at, count - taken, rows)
    }

    /// What the item at `at` is called, where items are called by name; where they are called by their place, the name is only noted.
    fn label(
        &mut self,
        context: &mut Context<'_>,
        at: usize,
        place: usize,
        rows: &mut Rows,
    ) -> Result<Option<Label>, Fail> {
        // Only the item itself goes into the flat table; and what is wrong with it is told when it is read.
        let trace = context.trace.take();
        let found = match &mut self.called {
            Names::None => None,
            Names::Own { list, field, head } => {
                if head.is_none() {
                    let how = (false, self.part);
                    let (types, shape) = (context.types, context.shape);
                    let mut whole = compile(types, &self.kind, "", shape, rows, how)
                        .map_err(|_| other(at, &self.field, TOO_MANY))?;
                    let is_name = |op: &Op| matches!(op, Op::Text(name) if name == field);
                    let name = whole.ops.iter().position(is_name);
                    whole.ops.truncate(name.unwrap_or(0));
                    *head = Some(whole);
                }
                let text = head.as_mut().and_then(|head| {
                    let at = head.run(context, at, rows).ok()?;
                    context.text(at, field).ok()
                });
                text.map(|text| (text, Some(*list)))
            }
            Names::Of(list) => {
                let text = context.text(at, &self.field).ok();
                context.names.extend(text.clone());
                text.map(|text| (text, Some(*list)))
            }
            Names::Beside => context.names.get(place).map(|text| (text.clone(), None)),
        };
        context.trace = trace;
        let by_name = rows.by_name && matches!(self.called, Names::Own { .. } | Names::Beside);
        let mut label = by_name.then_some(Label::Place(place));
        if let Some((text, list)) = found {
            let name = &context.data[text.clone()];
            let name = name.strip_suffix(&[0]).unwrap_or(name);
            if by_name && !name.is_empty() {
                label = Some(Label::Name(name.into()));
            }
            if let Some(list) = list {
                if !rows.by_name {
                    rows.names.see(list, place, name);
                }
                context.hold_to(&text);
            }
        }
        Ok(label)
    }

    /// Steps over items without looking at them.
    fn skip(
        &self,
        context: &mut Context<'_>,
        mut at: usize,
        count: usize,
        rows: &mut Rows,
    ) -> Result<usize, Fail> {
        if let Some(prim) = self.prim {
            let start = align(at, prim.size(), context.shape);
            let bytes = count
                .checked_mul(prim.size())
                .ok_or_else(|| short(at, &self.field))?;
            return end_of(context.data, start, bytes, &self.field);
        }
        // One program for all items of a type: none holds items of its own type.
        let own = |(kind, part, _): &_| *kind == self.kind && *part == self.part;
        let known = context.skips.iter().position(own);
        let mut program = match known {
            Some(known) => std::mem::take(&mut context.skips[known].2),
            None => compile(
                context.types,
                &self.kind,
                "",
                context.shape,
                rows,
                (false, self.part),
            )
            .map_err(|_| other(at, &self.field, TOO_MANY))?,
        };
        let mut failed = None;
        for _ in 0..count {
            match program.run(context, at, rows) {
                // Items without bytes: the rest is as empty.
                Ok(end) if end == at => break,
                Ok(end) => at = end,
                Err(fail) => {
                    failed = Some(fail);
                    break;
                }
            }
        }
        match known {
            Some(known) => context.skips[known].2 = program,
            None => context.skips.push((self.kind.clone(), self.part, program)),
        }
        match failed {
            Some(fail) => Err(fail.within(&self.field)),
            None => Ok(at),
        }
    }
}
