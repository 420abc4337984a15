//! JSON as capture tools write it: every complaint names the key, what was expected and what was found.

mod text;

use anyhow::{Context, Result, bail, ensure};
use serde_json::{Map, Value};

/// Decodes the bytes of a file into text.
pub(super) fn decode(bytes: &[u8]) -> Result<String> {
    text::decode(bytes)
}

/// Parses a document.
pub(super) fn parse(text: &str) -> Result<Value> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    text::refuse_strangers(text)?;
    serde_json::from_str(&text::strict(text)).map_err(|error| {
        if error.is_eof() {
            anyhow::anyhow!("not valid JSON: {error}; the file ends too early, copy or write it again")
        } else {
            anyhow::anyhow!("not valid JSON: {error}; repair that place")
        }
    })
}

/// What to do about the value of a key.
pub(super) const REMEDY: &str = "correct or remove it";

/// What a value is, for messages.
pub(super) fn describe(value: &Value) -> String {
    match value {
        Value::Null => "null".into(),
        Value::Bool(flag) => format!("{flag}"),
        Value::Number(number) => format!("the number {number}"),
        Value::String(text) => format!("the text {:?}", shortened(text)),
        Value::Array(list) => format!("a list of {}", list.len()),
        Value::Object(_) => "an object".into(),
    }
}

/// The start of a text that a stranger wrote, short enough for a message.
pub(super) fn shortened(text: &str) -> String {
    match text.char_indices().nth(100) {
        None => text.to_owned(),
        Some((end, _)) => format!("{}…", &text[..end]),
    }
}

/// A number, also where it is written as text; NaN and infinities included.
fn real(value: &Value) -> Option<f64> {
    match value {
        Value::Number(number) => number.as_f64(),
        Value::String(text) => text.trim().parse().ok(),
        _ => None,
    }
}

/// The fields of one object, read by key and expected type. A key that is missing or null is `None`.
#[derive(Clone, Copy)]
pub(super) struct Fields<'a>(pub(super) &'a Map<String, Value>);

impl<'a> Fields<'a> {
    pub(super) fn get(self, key: &str) -> Option<&'a Value> {
        self.0.get(key).filter(|value| !value.is_null())
    }

    pub(super) fn has(self, keys: &[&str]) -> bool {
        keys.iter().any(|key| self.get(key).is_some())
    }

    /// The objects among some keys.
    pub(super) fn objects(self, keys: &[&str]) -> impl Iterator<Item = Self> {
        keys.iter().filter_map(move |key| self.get(key)?.as_object()).map(Self)
    }

    pub(super) fn number(self, key: &str) -> Result<Option<f64>> {
        let Some(value) = self.get(key) else {
            return Ok(None);
        };
        let number = real(value)
            .with_context(|| format!("`{key}` must be a number, found {}; {REMEDY}", describe(value)))?;
        ensure!(number.is_finite(), "`{key}` must be a finite number, found {number}; {REMEDY}");
        Ok(Some(number))
    }

    /// A number above zero and below `limit`.
    pub(super) fn positive(self, key: &str, limit: f64) -> Result<Option<f64>> {
        let number = self.number(key)?;
        if let Some(number) = number {
            ensure!(
                number > 0.0 && number < limit,
                "`{key}` must be above 0 and below {limit}, found {number}; {REMEDY}"
            );
        }
        Ok(number)
    }

    pub(super) fn text(self, key: &str) -> Result<Option<&'a str>> {
        match self.get(key) {
            None => Ok(None),
            Some(Value::String(text)) => Ok(Some(text)),
            Some(other) => bail!("`{key}` must be a text, found {}; {REMEDY}", describe(other)),
        }
    }

    /// True, false, one of these as text, or a number that is 0 or not.
    pub(super) fn flag(self, key: &str) -> Result<Option<bool>> {
        match self.get(key) {
            None => Ok(None),
            Some(Value::Bool(flag)) => Ok(Some(*flag)),
            Some(Value::Number(number)) => Ok(Some(number.as_f64() != Some(0.0))),
            Some(Value::String(text)) if text.eq_ignore_ascii_case("true") => Ok(Some(true)),
            Some(Value::String(text)) if text.eq_ignore_ascii_case("false") => Ok(Some(false)),
            Some(other) => bail!("`{key}` must be true or false, found {}; {REMEDY}", describe(other)),
        }
    }

    pub(super) fn list(self, key: &str) -> Result<Option<&'a [Value]>> {
        match self.get(key) {
            None => Ok(None),
            Some(Value::Array(list)) => Ok(Some(list)),
            Some(other) => bail!("`{key}` must be a list, found {}; {REMEDY}", describe(other)),
        }
    }

    /// A list of finite numbers, possibly nested.
    pub(super) fn numbers(self, key: &str) -> Result<Option<Vec<f64>>> {
        let Some(Matrix { numbers, .. }) = self.matrix(key)? else {
            return Ok(None);
        };
        ensure!(
            numbers.iter().all(|number| number.is_finite()),
            "`{key}` must have finite numbers only; {REMEDY}"
        );
        Ok(Some(numbers))
    }

    /// A list of numbers, flat or in rows; what is not finite or null is NaN or infinite.
    pub(super) fn matrix(self, key: &str) -> Result<Option<Matrix>> {
        let Some(value) = self.get(key) else {
            return Ok(None);
        };
        let Value::Array(rows) = value else {
            bail!("`{key}` must be a list of numbers, found {}; {REMEDY}", describe(value));
        };
        let mut numbers = Vec::with_capacity(16);
        if let Err(stranger) = flatten(rows, &mut numbers) {
            bail!("`{key}` must be a list of numbers, found {} in it; {REMEDY}", describe(stranger));
        }
        let columns = rows.first().and_then(Value::as_array).map(Vec::len);
        Ok(Some(Matrix { rows: columns.map(|columns| [rows.len(), columns]), numbers }))
    }
}

/// Numbers, and the rows and columns that they were written in.
pub(super) struct Matrix {
    pub(super) rows: Option<[usize; 2]>,
    pub(super) numbers: Vec<f64>,
}

/// Appends the numbers of a list, or finds the first value in it that is none.
fn flatten<'a>(list: &'a [Value], numbers: &mut Vec<f64>) -> std::result::Result<(), &'a Value> {
    for value in list {
        match value {
            Value::Array(list) => flatten(list, numbers)?,
            Value::Null => numbers.push(f64::NAN),
            other => numbers.push(real(other).ok_or(other)?),
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_may_be_text_and_must_be_finite() {
        let value = parse("\u{feff}{\"a\": \" 1.5\", \"b\": NaN, \"c\": \"x\", \"d\": null}").expect("JSON");
        let fields = Fields(value.as_object().expect("object"));
        assert_eq!(fields.number("a").expect("a number"), Some(1.5));
        assert_eq!(fields.number("d").expect("missing"), None);
        for (key, expected) in [("b", "a finite number, found NaN"), ("c", "a number, found the text \"x\"")]
        {
            let message = fields.number(key).expect_err("refused").to_string();
            assert!(message.contains(expected), "{message}");
        }
    }

    #[test]
    fn errors_say_where() {
        for (text, expected) in [
            ("{\n/* x\n*/ \"a\": ,}", "line 3 column 9"),
            ("{\"a\": \"open", "ends too early"),
            ("  ", "an empty file"),
            ("<!DOCTYPE html>", "a web page"),
            ("version https://git-lfs.github.com/spec/v1", "git lfs pull"),
        ] {
            let message = format!("{:#}", parse(text).expect_err("refused"));
            assert!(message.contains(expected), "{message}");
        }
    }
}
