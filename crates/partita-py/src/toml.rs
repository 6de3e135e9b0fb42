//! TOML with the lines of everything in it.

use crate::failure::{guarded, raise, Field};
use pyo3::prelude::*;
use serde_json::{Map, Value as Json};
use toml_edit::{Document, Item, Table, TableLike, Value};

struct Lines {
    /// Where each line but the first begins, ascending.
    begins: Vec<usize>,
    found: Map<String, Json>,
}

impl Lines {
    fn new(text: &str) -> Self {
        let begins = text.bytes().enumerate().filter(|x| x.1 == b'\n').map(|x| x.0 + 1).collect();
        Self { begins, found: Map::new() }
    }

    fn line(&self, at: usize) -> usize {
        1 + self.begins.partition_point(|&begin| begin <= at)
    }
    fn note(&mut self, path: &str, span: Option<std::ops::Range<usize>>) {
        if let Some(span) = span {
            let line = self.line(span.start);
            self.found.entry(path.to_string()).or_insert_with(|| line.into());
        }
    }

    fn table(&mut self, table: &dyn TableLike, path: &str) -> Json {
        let mut out = Map::new();
        for (key, item) in table.iter() {
            let here = format!("{path}/{}", key.replace('~', "~0").replace('/', "~1"));
            self.note(&here, table.key(key).and_then(|k| k.span()));
            self.note(&here, item.span());
            let value = self.item(item, &here);
            out.insert(key.to_string(), value);
        }
        Json::Object(out)
    }

    fn item(&mut self, item: &Item, path: &str) -> Json {
        match item {
            Item::None => Json::Null,
            Item::Value(v) => self.value(v, path),
            Item::Table(t) => self.table(t, path),
            Item::ArrayOfTables(all) => {
                let rows: Vec<&Table> = all.iter().collect();
                Json::Array(
                    rows.into_iter()
                        .enumerate()
                        .map(|(i, t)| {
                            let here = format!("{path}/{i}");
                            self.note(&here, t.span());
                            self.table(t, &here)
                        })
                        .collect(),
                )
            }
        }
    }

    fn value(&mut self, v: &Value, path: &str) -> Json {
        match v {
            Value::String(s) => s.value().as_str().into(),
            Value::Integer(i) => (*i.value()).into(),
            // JSON knows no infinities: they travel as words and are refused as what they are
            Value::Float(f) => serde_json::Number::from_f64(*f.value())
                .map_or_else(|| Json::String(format!("{}", f.value())), Json::Number),
            Value::Boolean(b) => (*b.value()).into(),
            Value::Datetime(d) => d.value().to_string().into(),
            Value::Array(a) => Json::Array(
                a.iter()
                    .enumerate()
                    .map(|(i, v)| {
                        let here = format!("{path}/{i}");
                        self.note(&here, v.span());
                        self.value(v, &here)
                    })
                    .collect(),
            ),
            Value::InlineTable(t) => self.table(t, path),
        }
    }
}

/// JSON of the document, and JSON of {"/body/0/mass": line} with lines from 1.
#[pyfunction]
pub fn parse_toml(py: Python<'_>, text: &str, path: &str) -> PyResult<(String, String)> {
    guarded(py, || {
        let mut lines = Lines::new(text);
        match Document::parse(text) {
            Ok(document) => {
                let json = lines.table(document.as_table(), "");
                Ok((json.to_string(), Json::Object(lines.found).to_string()))
            }
            Err(e) => {
                let line = e.span().map(|s| lines.line(s.start));
                let place = line.map_or_else(|| path.to_string(), |l| format!("{path}, line {l}"));
                let message = format!("{place}: {}", e.message().replace('\n', " "));
                let mut fields: Vec<(&str, Field)> = vec![("path", path.into())];
                if let Some(l) = line {
                    fields.push(("line", l.into()));
                }
                Err(raise(py, "FileFormatError", &message, &fields))
            }
        }
    })
}
