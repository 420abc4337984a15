//! An axis: its range, and where its ticks are.

use super::Scale;
use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, Ranged, ValueFormatter};
use std::ops::Range;

/// Ticks that an axis should have about.
const TICKS: f64 = 6.0;
/// Numbers beyond these are drawn at the border: differences must stay finite.
const LARGEST: f64 = 1e300;
/// The smallest range, as a part of its largest number, that f64 divides into ticks.
const NARROWEST: f64 = 1e-9;

/// Where `value` lies along an axis: itself, or its decimal logarithm. `None` where the axis has no place for it.
pub(super) fn ratio(scale: Scale, value: f64) -> Option<f64> {
    match scale {
        Scale::Linear => value.is_finite().then(|| value.clamp(-LARGEST, LARGEST)),
        Scale::Log => (value.is_finite() && value > 0.0).then(|| value.log10()),
    }
}

/// What an axis covers, along itself.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reach {
    scale: Scale,
    from: f64,
    to: f64,
}

impl Reach {
    /// The range of some places on the axis; `padded` leaves some room at both ends.
    pub(super) fn new(scale: Scale, places: impl Iterator<Item = f64>, padded: bool) -> Self {
        let (from, to) = places
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(from, to), place| (from.min(place), to.max(place)));
        let span = to - from;
        let widen = match scale {
            _ if from > to => return Self { scale, from: 0.0, to: 1.0 },
            Scale::Linear if span <= NARROWEST * from.abs().max(to.abs()) => (from.abs() * 0.1).max(1e-3),
            Scale::Log if span <= NARROWEST => 0.5,
            _ if padded => span * 0.05,
            _ => 0.0,
        };
        Self { scale, from: from - widen, to: to + widen }
    }

    /// Places and labels of the ticks.
    pub(super) fn ticks(&self) -> Vec<(f64, String)> {
        if self.scale == Scale::Linear {
            return linear_ticks(self.from, self.to);
        }
        let decades = (self.to - self.from) / TICKS;
        if decades > 0.5 {
            let every = decades.ceil() as i64;
            let exponents =
                (self.from / every as f64).ceil() as i64..=(self.to / every as f64).floor() as i64;
            return exponents.map(|n| ((n * every) as f64, power(1, n * every))).collect();
        }
        let digits: &[i64] = if self.to - self.from > 1.0 { &[1, 3] } else { &[1, 2, 3, 5, 7] };
        let exponents = self.from.floor() as i64..=self.to.floor() as i64;
        let marks = exponents.flat_map(|n| {
            digits.iter().map(move |&digit| (n as f64 + (digit as f64).log10(), power(digit, n)))
        });
        let marks: Vec<_> = marks.filter(|(at, _)| (self.from..=self.to).contains(at)).collect();
        if marks.len() > 2 {
            return marks;
        }
        let even = linear_ticks(10f64.powf(self.from), 10f64.powf(self.to));
        even.into_iter().filter(|tick| tick.0 > 0.0).map(|(value, text)| (value.log10(), text)).collect()
    }
}

impl Ranged for Reach {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, place: &f64, (start, end): (i32, i32)) -> i32 {
        let part = ((place - self.from) / (self.to - self.from)).clamp(0.0, 1.0);
        start + (f64::from(end - start) * part).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        let ticks = if hint.weight().allow_light_points() { Vec::new() } else { self.ticks() };
        ticks.into_iter().map(|(at, _)| at).collect()
    }

    fn range(&self) -> Range<f64> {
        self.from..self.to
    }
}

impl ValueFormatter<f64> for Reach {
    fn format_ext(&self, place: &f64) -> String {
        let found = self.ticks().into_iter().find(|(at, _)| at == place);
        found.map_or_else(String::new, |(_, label)| label)
    }
}

/// Multiples of 1, 2 or 5 times a power of ten.
fn linear_ticks(from: f64, to: f64) -> Vec<(f64, String)> {
    let rough = (to - from) / TICKS;
    let decade = 10f64.powf(rough.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0].map(|factor| factor * decade).into_iter().find(|step| *step >= rough);
    let step = step.unwrap_or(rough);
    let numbers = (from / step).ceil() as i64..=(to / step).floor() as i64;
    let largest = from.abs().max(to.abs());
    numbers.map(|n| n as f64 * step).map(|value| (value, label(value, step, largest))).collect()
}

/// A multiple of `step`, with a unit prefix or a power of ten where the `largest` on its axis asks for one.
fn label(value: f64, step: f64, largest: f64) -> String {
    let (unit, prefix) = match largest {
        _ if !(1e-3..1e12).contains(&largest) => {
            let exponent = largest.log10().floor();
            let mantissa = label(value / 10f64.powf(exponent), step / 10f64.powf(exponent), 9.0);
            return if value == 0.0 {
                "0".to_owned()
            } else {
                format!("{mantissa}·{}", power(1, exponent as i64))
            };
        }
        _ if largest >= 1e9 => (1e9, " G"),
        _ if largest >= 1e6 => (1e6, " M"),
        _ if largest >= 1e4 => (1e3, " k"),
        _ => (1.0, ""),
    };
    if value == 0.0 {
        return "0".to_owned();
    }
    let decimals = (-(step / unit).log10() - 1e-9).ceil().clamp(0.0, 9.0) as usize;
    format!("{:.decimals$}{prefix}", value / unit).replace('-', "−")
}

/// `digit · 10^exponent`.
fn power(digit: i64, exponent: i64) -> String {
    let superscript = |c: char| match c {
        '-' => '⁻',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        digit => digit.to_digit(10).and_then(|n| char::from_u32(0x2070 + n)).unwrap_or(digit),
    };
    let ten: String = "10".chars().chain(exponent.to_string().chars().map(superscript)).collect();
    match (digit, exponent) {
        (digit, 0) => digit.to_string(),
        (1, 1) => "10".to_owned(),
        (1, _) => ten,
        (digit, -2..=3) => {
            format!(
                "{:.*}",
                usize::try_from(-exponent).unwrap_or(0),
                digit as f64 * 10f64.powi(exponent as i32)
            )
        }
        (digit, _) => format!("{digit}·{ten}"),
    }
}
