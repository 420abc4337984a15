//! Values of the library by their names, as one of a few on the command line.

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::{Arg, Command, Error};
use serde::Serialize;
use std::ffi::OsStr;

/// A parser of one of these values: name, help, value.
#[derive(Clone, Debug)]
pub(crate) struct OneOf<T>(Vec<(String, &'static str, T)>);

impl<T> OneOf<T> {
    /// Values by names of the command line's own.
    pub(crate) fn new(values: impl IntoIterator<Item = (String, &'static str, T)>) -> Self {
        Self(values.into_iter().collect())
    }
}

impl<T: Serialize> OneOf<T> {
    /// Values by the names that they have in files.
    pub(crate) fn named(values: impl IntoIterator<Item = (T, &'static str)>) -> Self {
        let name = |value: &T| match serde_json::to_value(value) {
            Ok(serde_json::Value::String(name)) => name,
            other => unreachable!("a value without fields is a string, not {other:?}"),
        };
        Self::new(values.into_iter().map(|(value, help)| (name(&value), help, value)))
    }
}

impl<T: Clone + Send + Sync + 'static> TypedValueParser for OneOf<T> {
    type Value = T;

    fn parse_ref(&self, command: &Command, argument: Option<&Arg>, text: &OsStr) -> Result<T, Error> {
        let known =
            PossibleValuesParser::new(self.0.iter().map(|(name, ..)| PossibleValue::new(name.clone())));
        let text = known.parse_ref(command, argument, text)?;
        let found = self.0.iter().find(|(name, ..)| *name == text);
        found.map(|(.., value)| value.clone()).ok_or_else(|| Error::new(clap::error::ErrorKind::InvalidValue))
    }

    fn possible_values(&self) -> Option<Box<dyn Iterator<Item = PossibleValue> + '_>> {
        let values = self.0.iter().map(|(name, help, _)| PossibleValue::new(name.clone()).help(*help));
        Some(Box::new(values))
    }
}
