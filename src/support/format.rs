//! Numbers as people say them.

use glam::DVec3;

/// A duration as people say it.
#[must_use]
pub fn duration(seconds: f64) -> String {
    match seconds.max(0.0).round() as u64 {
        _ if seconds < 10.0 => format!("{:.1} s", seconds.max(0.0)),
        seconds @ 0..120 => format!("{seconds} s"),
        seconds @ 120..7200 => format!("{} min {:02} s", seconds / 60, seconds % 60),
        seconds => format!("{} h {:02} min", seconds / 3600, seconds / 60 % 60),
    }
}

/// A rate or count with a unit prefix.
#[must_use]
pub fn short(number: f64) -> String {
    match number {
        number if number >= 1e6 => format!("{:.1}M", number / 1e6),
        number if number >= 1e3 => format!("{:.1}k", number / 1e3),
        number => format!("{number:.0}"),
    }
}

/// An amount of memory.
#[must_use]
pub fn bytes(count: u64) -> String {
    const UNITS: [&str; 4] = ["bytes", "KiB", "MiB", "GiB"];
    let mut unit = 0;
    let mut value = count as f64;
    while value >= 1024.0 && unit + 1 < UNITS.len() {
        value /= 1024.0;
        unit += 1;
    }
    let digits = usize::from(unit > 0 && value < 99.95);
    format!("{value:.digits$} {}", UNITS[unit])
}

/// A length with three or four digits, in plain figures where that is short.
#[must_use]
pub fn length(value: f64) -> String {
    let size = value.abs();
    if size != 0.0 && !(1e-3..1e6).contains(&size) {
        return format!("{value:.2e}");
    }
    if size == 0.0 {
        return "0".to_owned();
    }
    // Small numbers are shown with three digits, as those below them are with three decimals.
    let power = size.log10().floor();
    let decimals = if power < -1.0 { 2.0 - power } else { (3.0 - power).clamp(0.0, 3.0) };
    format!("{value:.*}", decimals as usize)
}

/// A point; what is nothing on the scale of its surroundings is 0.
#[must_use]
pub fn point(at: DVec3, scale: f64) -> String {
    let [x, y, z] = at.to_array().map(|value| length(if value.abs() < 1e-4 * scale { 0.0 } else { value }));
    format!("({x}, {y}, {z})")
}

/// A part of a whole.
#[must_use]
pub fn percent(part: f64) -> String {
    let percent = 100.0 * part;
    let digits = usize::from((0.05..9.95).contains(&percent));
    format!("{percent:.digits$} %")
}

/// `1 frame`, `2 frames`.
#[must_use]
pub fn count(number: usize, thing: &str) -> String {
    if number == 1 { format!("1 {thing}") } else { format!("{number} {thing}s") }
}

/// The words that fit a number: `one` for 1, else `many`.
#[must_use]
pub fn plural<'a>(number: u64, one: &'a str, many: &'a str) -> &'a str {
    if number == 1 { one } else { many }
}

/// The first few of some names.
#[must_use]
pub fn few(names: &[impl AsRef<str>]) -> String {
    let mut text = names.iter().take(3).map(AsRef::as_ref).collect::<Vec<_>>().join(", ");
    if names.len() > 3 {
        text += ", …";
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        let all = [0.25, 42.4, 119.0, 125.0, 7384.0].map(duration);
        assert_eq!(all, ["0.2 s", "42 s", "119 s", "2 min 05 s", "2 h 03 min"]);
        assert_eq!([7.0, 1234.0, 5.67e6].map(short), ["7", "1.2k", "5.7M"]);
        let memory = [7, 1536, 400 << 20, 8_294_400_000].map(bytes);
        assert_eq!(memory, ["7 bytes", "1.5 KiB", "400 MiB", "7.7 GiB"]);
        let lengths = [0.0, 1e-9, -0.04321, 1.5, -23.456, 123456.7, 2e7].map(length);
        assert_eq!(lengths, ["0", "1.00e-9", "-0.0432", "1.500", "-23.46", "123457", "2.00e7"]);
        assert_eq!(point(DVec3::new(1e-9, -2.0, 0.5), 4.0), "(0, -2.000, 0.500)");
        assert_eq!([0.0, 0.0001, 0.012, 0.5, 1.0].map(percent), ["0 %", "0 %", "1.2 %", "50 %", "100 %"]);
        assert_eq!([count(1, "frame"), count(3, "frame")], ["1 frame", "3 frames"]);
    }

    #[test]
    fn a_few_names_stand_for_many() {
        assert_eq!([few(&["a"]), few(&["a", "b", "c"])], ["a", "a, b, c"]);
        assert_eq!(few(&["a", "b", "c", "d"]), "a, b, c, …");
    }
}
