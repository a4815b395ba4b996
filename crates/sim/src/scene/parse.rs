//! Text → [`Scene`], with errors that point at the line.

use super::{BUILTIN, Scene, builtin, check};
use crate::effects::TABLE;
use recording::text::{document, meant::did_you_mean, read_text};
use std::path::Path;

/// Why a scene cannot be used: one sentence that says where, what was found and what to do.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum SceneError {
    /// Neither a built-in scene nor a readable file.
    #[error("{0}")]
    NotFound(String),
    /// The text is not what a scene looks like.
    #[error("{origin}:{line}:{column}: {message}")]
    At {
        /// File or built-in name.
        origin: String,
        /// Line, from 1.
        line: usize,
        /// Column, from 1.
        column: usize,
        /// What is wrong there.
        message: String,
    },
    /// A `--set` or a value that no single line can be blamed for.
    #[error("{origin}: {message}")]
    Value {
        /// File, built-in name or `--set`.
        origin: String,
        /// What is wrong.
        message: String,
    },
}

/// Reads a built-in scene or a file, changes it by `key=value` settings, and checks it.
///
/// # Errors
/// [`SceneError`]: unknown scene (with the nearest name), unknown key, wrong type or sign (with line and column).
pub fn load(name_or_path: &str, settings: &[String]) -> Result<Scene, SceneError> {
    if let Some(text) = builtin(name_or_path) {
        return parse(name_or_path, text, settings);
    }
    let path = Path::new(name_or_path);
    let looks_like_a_path =
        path.extension().is_some() || name_or_path.contains(std::path::MAIN_SEPARATOR);
    match read_text(path) {
        Ok(text) => parse(name_or_path, &text, settings),
        Err(e) if looks_like_a_path => Err(SceneError::NotFound(format!(
            "cannot read the scene {name_or_path}: {e}"
        ))),
        Err(_) => {
            let names: Vec<&str> = BUILTIN.iter().map(|(n, _)| *n).collect();
            let hint = did_you_mean(name_or_path, names.iter().copied());
            Err(SceneError::NotFound(format!(
                "there is no scene `{name_or_path}`.{hint} Built in: {}; or give the path of a .toml file",
                names.join(", ")
            )))
        }
    }
}

/// Parses and checks `text`; `origin` names it in errors.
///
/// # Errors
/// As [`load`].
pub fn parse(origin: &str, text: &str, settings: &[String]) -> Result<Scene, SceneError> {
    let scene: Scene = from_toml(origin, text)?;
    let table: toml::Table = from_toml(origin, text)?;
    if let Some(key) = list_for_table(&table, &scene) {
        let message = format!("{key}: {LIST_FOR_TABLE}");
        return Err(located(origin, text, find(text, &key), &message));
    }
    let checked = |scene: &mut Scene| scene.expand().and_then(|()| check(scene));
    if let Some(places) = places_twice(&scene, &table) {
        return Err(located(origin, text, find(text, HANDLES), &places));
    }
    let mut changed = if settings.is_empty() {
        scene.clone()
    } else {
        apply(scene.clone(), settings)?
    };
    checked(&mut changed).map_err(|problem| {
        // What is wrong only with the settings is theirs, whatever the key.
        let was_set = !settings.is_empty() && checked(&mut scene.clone()).is_ok();
        let message = format!("{}: {}", problem.key, problem.message);
        match find(text, &problem.key) {
            Some(span) if !was_set => located(origin, text, Some(span), &message),
            _ => SceneError::Value {
                origin: if was_set {
                    "--set".into()
                } else {
                    origin.into()
                },
                message,
            },
        }
    })?;
    Ok(changed)
}

const HANDLES: &str = "carriers.handles_m";

/// What is wrong where a scene's text places the carriers by hand and, elsewhere, along poles. A printed scene has both alike.
fn places_twice(scene: &Scene, text: &toml::Table) -> Option<String> {
    text.get("carriers")?.get("handles_m")?;
    let mut along = scene.clone();
    along.expand().ok()?;
    (along.carriers.handles_m != scene.carriers.handles_m).then(|| {
        format!(
            "{HANDLES}: other places than those of carriers.along_poles; leave one of the two out"
        )
    })
}

/// What is wrong where settings give places by hand to carriers who stand along poles.
fn overruled<'a>(table: &toml::Table, mut keys: impl Iterator<Item = &'a str>) -> Option<String> {
    table.get("carriers")?.get("along_poles")?;
    keys.any(|key| key.starts_with(HANDLES)).then(|| {
        format!("{HANDLES}: carriers.along_poles places the carriers; take it away first with carriers.along_poles=false")
    })
}

const LIST_FOR_TABLE: &str = "found a list, expected a table";

/// Whether there is a list in it.
fn holds_list(value: &toml::Value) -> bool {
    match value {
        toml::Value::Array(_) => true,
        toml::Value::Table(inner) => inner.values().any(holds_list),
        _ => false,
    }
}

/// The key of a list that serde took for a table's values in their order, which nobody means.
fn list_for_table(given: &toml::Table, scene: &Scene) -> Option<String> {
    fn within(given: &toml::Value, meant: &toml::Value) -> Option<String> {
        use toml::Value::{Array, Table};
        let below = |name: String, more: String| match more.is_empty() {
            true => name,
            false => format!("{name}.{more}"),
        };
        match (given, meant) {
            (Array(_), Table(_)) => Some(String::new()),
            (Table(given), Table(meant)) => given.iter().find_map(|(name, value)| {
                within(value, meant.get(name)?).map(|more| below(name.clone(), more))
            }),
            (Array(given), Array(meant)) => {
                (given.iter().zip(meant).enumerate()).find_map(|(k, (given, meant))| {
                    within(given, meant).map(|m| below(k.to_string(), m))
                })
            }
            _ => None,
        }
    }
    let meant: toml::Table = toml::from_str(&to_toml(scene)).ok()?;
    within(&given.clone().into(), &meant.into())
}

/// Reads anything from TOML with errors as readable as a scene's: line and column, and the nearest name after a slip.
///
/// # Errors
/// [`SceneError::At`].
pub fn from_toml<T: serde::de::DeserializeOwned>(
    origin: &str,
    text: &str,
) -> Result<T, SceneError> {
    toml::from_str(text).map_err(|e| located(origin, text, e.span(), &readable(e.message())))
}

/// The scene as TOML, complete with every default.
pub fn to_toml(scene: &Scene) -> String {
    // OK because every field of a scene is a TOML value and keys are strings.
    toml::to_string(scene).expect("a scene is always expressible in TOML")
}

/// JSON Schema of a scene (draft 2020-12), for editors that check TOML; made from the types themselves.
pub fn json_schema() -> serde_json::Value {
    schemars::schema_for!(Scene).to_value()
}

/// A scene that is about to be changed many times: its keys are looked up in a table that is made once.
#[derive(Clone, Debug)]
pub struct Template {
    origin: String,
    text: String,
    table: toml::Table,
}

impl Template {
    /// Reads a built-in scene or a file and changes it by `settings`, as [`load`] does.
    ///
    /// # Errors
    /// As [`load`].
    pub fn load(name_or_path: &str, settings: &[String]) -> Result<Self, SceneError> {
        load(name_or_path, settings).map(|scene| Self::of(&scene))
    }

    /// A template of a scene, whose name stands in errors: where it was read from does not matter to a run.
    pub fn of(scene: &Scene) -> Self {
        let text = to_toml(scene);
        Self {
            origin: scene.name.clone(),
            // OK because the text was made from a table a moment ago.
            table: toml::from_str(&text).expect("TOML that was just written is TOML"),
            text,
        }
    }

    /// The scene that this is a template of, as TOML with every default.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// What stands at a dotted key.
    pub fn value(&self, key: &str) -> Option<&toml::Value> {
        let mut parts = key.split('.');
        let first = self.table.get(parts.next()?)?;
        parts.try_fold(first, |value, part| match value {
            toml::Value::Table(inner) => inner.get(part),
            toml::Value::Array(items) => items.get(part.parse::<usize>().ok()?),
            _ => None,
        })
    }

    /// The scene with other values at some dotted keys, checked.
    ///
    /// # Errors
    /// As [`load`]: unknown key, wrong type, a value that a scene may not have.
    pub fn with<'a>(
        &self,
        values: impl IntoIterator<Item = (&'a str, toml::Value)>,
    ) -> Result<Scene, SceneError> {
        let fail = |message: String| SceneError::Value {
            origin: self.origin.clone(),
            message,
        };
        let mut table = self.table.clone();
        let (mut keys, mut lists): (Vec<&str>, bool) = (Vec::new(), false);
        let mut gone = Vec::new();
        for (key, value) in values {
            lists |= holds_list(&value);
            set_key(&mut table, key, value, &mut gone).map_err(|m| fail(format!("{key}: {m}")))?;
            keys.push(key);
        }
        if let Some(message) = overruled(&table, keys.iter().copied()) {
            return Err(fail(message));
        }
        // A list where a table is meant is sought where it can be only: a study asks for many scenes.
        let given = lists.then(|| table.clone());
        let mut scene: Scene = table.try_into().map_err(|e: toml::de::Error| {
            fail(format!("{}: {}", keys.join(", "), readable(e.message())))
        })?;
        if let Some(key) = given.and_then(|given| list_for_table(&given, &scene)) {
            return Err(fail(format!("{key}: {LIST_FOR_TABLE}")));
        }
        scene
            .expand()
            .and_then(|()| check(&scene))
            .map_err(|problem| fail(format!("{}: {}", problem.key, problem.message)))?;
        Ok(scene)
    }
}

/// The value of a setting: TOML, or a string where it is not.
pub fn setting_value(text: &str) -> toml::Value {
    toml::from_str::<toml::Table>(&format!("x = {text}"))
        .ok()
        // One line more would be another setting.
        .filter(|t| t.len() == 1)
        .and_then(|mut t| t.remove("x"))
        .unwrap_or_else(|| toml::Value::String(text.into()))
}

/// Applies `a.b.c=value` settings; the value is TOML, or a string where it is not.
fn apply(scene: Scene, settings: &[String]) -> Result<Scene, SceneError> {
    let fail = |message: String| SceneError::Value {
        origin: "--set".into(),
        message,
    };
    let mut table: toml::Table =
        toml::from_str(&to_toml(&scene)).map_err(|e| fail(e.message().into()))?;
    let mut gone = Vec::new();
    for setting in settings {
        let Some((key, value)) = setting.split_once('=') else {
            return Err(fail(format!(
                "`{setting}` is not KEY=VALUE, for example effects.gait.amplitude_m=0.07"
            )));
        };
        let (key, value) = (key.trim(), value.trim());
        set_key(&mut table, key, setting_value(value), &mut gone)
            .map_err(|m| fail(format!("{key}: {m}")))?;
        // One setting at a time, so that the message names the setting at fault.
        match toml::Table::try_into::<Scene>(table.clone()) {
            Ok(scene) => {
                if let Some(key) = list_for_table(&table, &scene) {
                    return Err(fail(format!("{key}: {LIST_FOR_TABLE}")));
                }
            }
            Err(e) => {
                let setting = setting.replace('\n', " ");
                return Err(fail(format!("{setting}: {}", readable(e.message()))));
            }
        }
    }
    let keys = settings.iter().filter_map(|s| s.split('=').next());
    if let Some(message) = overruled(&table, keys.map(str::trim)) {
        return Err(fail(message));
    }
    table
        .try_into()
        .map_err(|e: toml::de::Error| fail(readable(e.message())))
}

/// Whether `KEY=false` takes a key away: what has no default but to be absent.
fn may_be_absent(path: &[&str]) -> bool {
    match path {
        ["effects", name] => TABLE.iter().any(|effect| effect.name == *name),
        _ => matches!(
            path,
            ["start", "height_m"]
                | ["carriers", "along_poles"]
                | ["effects", "gait", "harmonics", _, "carriers"]
                | ["effects", "imu", "sensors", _, "name"]
        ),
    }
}

/// Puts a value at a dotted key, or takes away what is there, if anything is. `gone` are the keys taken away so far: a part of one of them would
/// bring it back with every other value a default, which nobody means.
fn set_key<'a>(
    table: &mut toml::Table,
    key: &'a str,
    value: toml::Value,
    gone: &mut Vec<&'a str>,
) -> Result<(), String> {
    let path: Vec<&str> = key.split('.').collect();
    let within = |whole: &str| key.strip_prefix(whole)?.strip_prefix('.');
    if let Some((whole, part)) = gone.iter().find_map(|w| Some((w, within(w)?))) {
        return Err(format!(
            "{whole}=false took it away before; leave one of the two out, or give it anew with {whole}={{ {part} = … }}"
        ));
    }
    let takes_away = value == toml::Value::Boolean(false) && may_be_absent(&path);
    // An effect that is on is as the scene has it, else with its defaults.
    let value = match (&value, &path[..]) {
        (toml::Value::Boolean(true), ["effects", effect]) => {
            let effects = table.get("effects").and_then(toml::Value::as_table);
            let there = effects.and_then(|effects| effects.get(*effect));
            there.cloned().unwrap_or_else(|| toml::Table::new().into())
        }
        _ => value,
    };
    gone.retain(|whole| *whole != key);
    if takes_away {
        gone.push(key);
    }
    put(table, &path, value, takes_away)
}

fn put(
    table: &mut toml::Table,
    path: &[&str],
    value: toml::Value,
    takes_away: bool,
) -> Result<(), String> {
    let (first, rest) = (path[0], &path[1..]);
    if first.is_empty() {
        return Err("an empty name in the key".into());
    }
    if rest.is_empty() {
        if takes_away {
            table.remove(first);
            return Ok(());
        }
        // Whole numbers stand for reals where a real was.
        let value = match (table.get(first), value) {
            (Some(toml::Value::Float(_)), toml::Value::Integer(i)) => toml::Value::Float(i as f64),
            (_, v) => v,
        };
        table.insert(first.into(), value);
        return Ok(());
    }
    if !table.contains_key(first) && rest[0].parse::<usize>().is_ok() {
        return Err(format!(
            "there is no list `{first}` yet; give all of it, {first}=[…]"
        ));
    }
    match table
        .entry(first)
        .or_insert_with(|| toml::Value::Table(toml::Table::new()))
    {
        toml::Value::Table(inner) => put(inner, rest, value, takes_away),
        toml::Value::Array(items) => {
            let index: usize = rest[0]
                .parse()
                .map_err(|_| format!("`{first}` is a list; name an item by its number"))?;
            let length = items.len();
            let item = items
                .get_mut(index)
                .ok_or_else(|| format!("`{first}` has {length} items, there is no item {index}"))?;
            match (item, &rest[1..]) {
                (slot, []) => *slot = value,
                (toml::Value::Table(inner), deeper) => put(inner, deeper, value, takes_away)?,
                (toml::Value::Array(inner), [last]) => {
                    let i: usize = last
                        .parse()
                        .map_err(|_| format!("`{last}` is not the number of an item"))?;
                    *inner
                        .get_mut(i)
                        .ok_or_else(|| format!("there is no item {i}"))? = value;
                }
                _ => return Err(format!("`{}` holds no further keys", rest[0])),
            }
            Ok(())
        }
        _ => Err(format!(
            "`{first}` is a single value and holds no further keys"
        )),
    }
}

/// As of any document, but for what is a scene's own.
fn readable(message: &str) -> String {
    let message = document::readable(message);
    // An effect is a table: `hold = true` is near, but none.
    if let Some((found, _)) = message.split_once(", expected struct ") {
        return format!("{found}, expected a table; `{{}}` is one with every default");
    }
    match message.as_str() {
        "missing field `name`" => "the scene has no `name`; begin with name = \"…\"".into(),
        "data did not match any variant of untagged enum PerCarrier" => {
            "expected a number, or a list with one for each carrier".into()
        }
        _ => message,
    }
}

fn located(
    origin: &str,
    text: &str,
    span: Option<std::ops::Range<usize>>,
    message: &str,
) -> SceneError {
    let Some(span) = span else {
        return SceneError::Value {
            origin: origin.into(),
            message: message.into(),
        };
    };
    let (line, column) = document::line_and_column(text, &span);
    SceneError::At {
        origin: origin.into(),
        line,
        column,
        message: message.into(),
    }
}

/// Where in `text` the value of a dotted key stands; the deepest part of the key that the text has.
fn find(text: &str, key: &str) -> Option<std::ops::Range<usize>> {
    use toml::de::DeValue;
    let document = toml::de::DeTable::parse(text).ok()?;
    let mut parts = key.split('.');
    let first = parts.next()?;
    let (_, mut value) = document
        .get_ref()
        .iter()
        .find(|(k, _)| k.get_ref() == first)?;
    for part in parts {
        let next = match value.get_ref() {
            DeValue::Table(inner) => inner
                .iter()
                .find(|(k, _)| k.get_ref() == part)
                .map(|(_, v)| v),
            DeValue::Array(items) => part.parse().ok().and_then(|i: usize| items.get(i)),
            _ => None,
        };
        match next {
            Some(v) => value = v,
            None => break,
        }
    }
    Some(value.span())
}
