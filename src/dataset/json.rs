//! JSON as capture tools write it: a byte-order mark and comments are tolerated, and every complaint
//! names the key, what was expected and what was found.

use anyhow::{Context, Result, bail, ensure};
use serde_json::{Map, Value};

/// Parses a document whose top level is an object.
pub(super) fn parse(text: &str) -> Result<Map<String, Value>> {
    let text = without_comments(text.strip_prefix('\u{feff}').unwrap_or(text))?;
    match serde_json::from_str(&text).context("not valid JSON")? {
        Value::Object(map) => Ok(map),
        other => bail!("expected a JSON object with a list `frames`, found {}", describe(&other)),
    }
}

/// Blanks out `//` and `/* */` comments, keeping every line and column, and refuses the non-numbers that
/// JSON cannot express but some writers emit.
fn without_comments(text: &str) -> Result<String> {
    let mut output = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(first) = rest.chars().next() {
        let (length, keep) = if first == '"' {
            (string_length(rest), true)
        } else if rest.starts_with("//") {
            (rest.find('\n').unwrap_or(rest.len()), false)
        } else if rest.starts_with("/*") {
            (rest.find("*/").map_or(rest.len(), |end| end + 2), false)
        } else if first.is_alphabetic() {
            let end = rest.find(|c: char| !c.is_alphanumeric());
            (end.unwrap_or(rest.len()), true)
        } else {
            (first.len_utf8(), true)
        };
        let (token, tail) = rest.split_at(length);
        if keep {
            let lower = token.to_ascii_lowercase();
            if ["nan", "inf", "infinity"].contains(&lower.as_str()) {
                let line = 1 + output.matches('\n').count();
                let column = 1 + output.len() - output.rfind('\n').map_or(0, |at| at + 1);
                bail!(
                    "expected a finite number, found `{token}` at line {line} column {column}; \
                     drop that frame or repair the tool that wrote it"
                );
            }
            output.push_str(token);
        } else {
            output.extend(token.chars().map(|c| if c == '\n' { '\n' } else { ' ' }));
        }
        rest = tail;
    }
    Ok(output)
}

/// Length of the string literal at the start of `text`, quotes included.
fn string_length(text: &str) -> usize {
    let mut escaped = false;
    for (at, c) in text.char_indices().skip(1) {
        match c {
            _ if escaped => escaped = false,
            '\\' => escaped = true,
            '"' => return at + 1,
            _ => {}
        }
    }
    text.len()
}

/// What a value is, for messages.
pub(super) fn describe(value: &Value) -> String {
    match value {
        Value::Null => "null".into(),
        Value::Bool(flag) => format!("{flag}"),
        Value::Number(number) => format!("the number {number}"),
        Value::String(text) => format!("the text {:?}", text.chars().take(40).collect::<String>()),
        Value::Array(list) => format!("a list of {}", list.len()),
        Value::Object(_) => "an object".into(),
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

    pub(super) fn number(self, key: &str) -> Result<Option<f64>> {
        let Some(value) = self.get(key) else {
            return Ok(None);
        };
        let number = value.as_f64().filter(|number| number.is_finite());
        match number {
            Some(number) => Ok(Some(number)),
            None => bail!("`{key}` must be a number, found {}", describe(value)),
        }
    }

    /// A number above zero and below `limit`.
    pub(super) fn positive(self, key: &str, limit: f64) -> Result<Option<f64>> {
        let number = self.number(key)?;
        if let Some(number) = number {
            ensure!(
                number > 0.0 && number < limit,
                "`{key}` must be above 0 and below {limit}, found {number}"
            );
        }
        Ok(number)
    }

    pub(super) fn text(self, key: &str) -> Result<Option<&'a str>> {
        match self.get(key) {
            None => Ok(None),
            Some(Value::String(text)) => Ok(Some(text)),
            Some(other) => bail!("`{key}` must be a text, found {}", describe(other)),
        }
    }

    /// True, false, or a number that is 0 or not.
    pub(super) fn flag(self, key: &str) -> Result<bool> {
        match self.get(key) {
            None => Ok(false),
            Some(Value::Bool(flag)) => Ok(*flag),
            Some(Value::Number(number)) => Ok(number.as_f64() != Some(0.0)),
            Some(other) => bail!("`{key}` must be true or false, found {}", describe(other)),
        }
    }

    pub(super) fn list(self, key: &str) -> Result<Option<&'a [Value]>> {
        match self.get(key) {
            None => Ok(None),
            Some(Value::Array(list)) => Ok(Some(list)),
            Some(other) => bail!("`{key}` must be a list, found {}", describe(other)),
        }
    }

    /// The numbers of a possibly nested list, one after the other.
    pub(super) fn numbers(self, key: &str) -> Result<Option<Vec<f64>>> {
        let Some(value) = self.get(key) else {
            return Ok(None);
        };
        let mut numbers = Vec::new();
        flatten(value, &mut numbers).with_context(|| format!("`{key}` must be a list of numbers"))?;
        Ok(Some(numbers))
    }
}

fn flatten(value: &Value, numbers: &mut Vec<f64>) -> Result<()> {
    match value {
        Value::Array(list) => list.iter().try_for_each(|item| flatten(item, numbers)),
        Value::Number(number) => {
            numbers.push(number.as_f64().context("a number is out of range")?);
            Ok(())
        }
        other => bail!("found {} in it", describe(other)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn comments_go_and_strings_stay() {
        let text = "\u{feff}{ // one\n/* two\n */ \"a // b\": \"c \\\" /* d */\", \"nan\": 1 }";
        let map = parse(text).expect("tolerated");
        assert_eq!(map["a // b"], "c \" /* d */");
        assert_eq!(map["nan"], 1);
    }

    #[test]
    fn errors_say_where() {
        for (text, expected) in [
            ("{\n  \"a\": NaN}", "found `NaN` at line 2 column 8"),
            ("{\"a\": [1, -Infinity]}", "found `Infinity` at line 1"),
            ("{\n/* x\n*/ \"a\": ,}", "line 3 column 9"),
            ("{\"a\": 1e999}", "number out of range"),
            ("[1, 2]", "found a list of 2"),
            ("{\"a\": \"open", "line 1"),
        ] {
            let message = format!("{:#}", parse(text).expect_err("refused"));
            assert!(message.contains(expected), "{message}");
        }
    }
}
