//! TOML as JSON, and the lines of its members.

use crate::failure::{guarded, raise, Field};
use crate::waiting::heard;
use pyo3::prelude::*;
use serde_json::{Map, Value as Json};
use std::ops::Range;
use toml_edit::{Document, Item, TableLike, TomlError, Value};

/// Bytes above which reading may take longer than a signal should wait.
const LONG: usize = 200_000;
/// Names with more parts than this are refused by the parser.
const PARTS: usize = 80;

fn line(text: &str, at: usize) -> usize {
    1 + text.as_bytes()[..at.min(text.len())].iter().filter(|b| **b == b'\n').count()
}

fn table(table: &dyn TableLike) -> Json {
    Json::Object(table.iter().map(|(key, x)| (key.to_string(), item(x))).collect())
}

fn item(item: &Item) -> Json {
    match item {
        Item::None => Json::Null,
        Item::Value(v) => value(v),
        Item::Table(t) => table(t),
        Item::ArrayOfTables(all) => Json::Array(all.iter().map(|t| table(t)).collect()),
    }
}

fn value(v: &Value) -> Json {
    match v {
        Value::String(s) => s.value().as_str().into(),
        Value::Integer(i) => (*i.value()).into(),
        // JSON has no infinities: they are passed as words and refused as infinite
        Value::Float(f) => serde_json::Number::from_f64(*f.value())
            .map_or_else(|| Json::String(format!("{}", f.value())), Json::Number),
        Value::Boolean(b) => (*b.value()).into(),
        Value::Datetime(d) => d.value().to_string().into(),
        Value::Array(a) => Json::Array(a.iter().map(value).collect()),
        Value::InlineTable(t) => table(t),
    }
}

/// Where the members of a list begin in the text; unknown ones begin where the list does.
fn begins(item: &Item) -> Vec<usize> {
    let start = item.span().map_or(0, |s| s.start);
    let at = |span: Option<Range<usize>>| span.map_or(start, |s| s.start);
    match item {
        Item::ArrayOfTables(all) => all.iter().map(|t| at(t.span())).collect(),
        Item::Value(Value::Array(all)) => all.iter().map(|v| at(v.span())).collect(),
        _ => Vec::new(),
    }
}

/// Target of a JSON pointer, as far as the document contains it: the position of the last existing key.
struct KeySearch<'t> {
    parts: std::str::Split<'t, char>,
    found: Option<usize>,
}

impl KeySearch<'_> {
    fn note(&mut self, span: Option<Range<usize>>) {
        if let Some(span) = span {
            self.found = Some(span.start);
        }
    }

    fn table(&mut self, table: &dyn TableLike) {
        let Some(part) = self.parts.next() else { return };
        let key = part.replace("~1", "/").replace("~0", "~");
        let Some((name, item)) = table.get_key_value(&key) else { return };
        self.note(name.span().or_else(|| item.span()));
        match item {
            Item::None => {}
            Item::Value(v) => self.value(v),
            Item::Table(t) => self.table(t),
            Item::ArrayOfTables(all) => {
                if let Some(t) = self.index().and_then(|i| all.get(i)) {
                    self.note(t.span());
                    self.table(t);
                }
            }
        }
    }

    fn value(&mut self, value: &Value) {
        match value {
            Value::Array(a) => {
                if let Some(v) = self.index().and_then(|i| a.get(i)) {
                    self.note(v.span());
                    self.value(v);
                }
            }
            Value::InlineTable(t) => self.table(t),
            _ => {}
        }
    }

    fn index(&mut self) -> Option<usize> {
        self.parts.next()?.parse().ok()
    }
}

fn refused(py: Python<'_>, text: &str, path: &str, e: &TomlError) -> PyErr {
    let dots = |x: &str| x.bytes().filter(|b| *b == b'.').count();
    let longest =
        text.lines().enumerate().max_by_key(|(i, x)| (dots(x), usize::MAX - i)).map(|(i, x)| (i + 1, dots(x) + 1));
    // the parser locates every error except a key with too many parts
    if let (None, Some((line, parts))) = (e.span(), longest.filter(|x| x.1 > PARTS)) {
        let message =
            format!("{path}, line {line}: a key with {parts} parts nests tables too deeply ({})", e.message().trim());
        return raise(py, "FileFormatError", &message, &[("path", path.into()), ("line", line.into())]);
    }
    let line = e.span().map(|s| line(text, s.start));
    let location = line.map_or_else(|| path.to_string(), |l| format!("{path}, line {l}"));
    let message = format!("{location}: {}", e.message().replace('\n', " "));
    let mut fields: Vec<(&str, Field)> = vec![("path", path.into())];
    if let Some(l) = line {
        fields.push(("line", l.into()));
    }
    raise(py, "FileFormatError", &message, &fields)
}

/// The document as JSON, and where the members of its lists begin.
fn read(text: &str) -> Result<(String, String), TomlError> {
    let document = Document::parse(text)?;
    let lists: Map<String, Json> = document
        .as_table()
        .iter()
        .map(|(key, x)| (key.to_string(), begins(x)))
        .filter(|(_, begins)| !begins.is_empty())
        .map(|(key, begins)| (key, begins.into()))
        .collect();
    Ok((table(document.as_table()).to_string(), Json::Object(lists).to_string()))
}

/// Line of the key that a JSON pointer names, or of the nearest one around it.
fn line_of(text: &str, pointer: &str) -> Result<Option<usize>, TomlError> {
    let document = Document::parse(text)?;
    let mut parts = pointer.split('/');
    parts.next(); // a pointer begins with a slash
    let mut search = KeySearch { parts, found: None };
    search.table(document.as_table());
    Ok(search.found.map(|at| line(text, at)))
}

/// JSON of the document, and JSON of {"body": [where each begins, in bytes]} for the lists in it.
#[pyfunction]
pub fn parse_toml(py: Python<'_>, text: &str, path: &str) -> PyResult<(String, String)> {
    guarded(py, || {
        let own = text.to_string();
        heard(py, text.len() > LONG, move || read(&own))?.map_err(|e| refused(py, text, path, &e))
    })
}

/// Line, from 1, of the key that a JSON pointer names, or of the nearest one around it; None where it is unknown.
#[pyfunction]
pub fn toml_line(py: Python<'_>, text: &str, pointer: &str) -> PyResult<Option<usize>> {
    guarded(py, || {
        let own = (text.to_string(), pointer.to_string());
        heard(py, text.len() > LONG, move || line_of(&own.0, &own.1))?.map_err(|e| refused(py, text, "text", &e))
    })
}
