//! Numbers as people say them.

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
    }

    #[test]
    fn a_few_names_stand_for_many() {
        assert_eq!([few(&["a"]), few(&["a", "b", "c"])], ["a", "a, b, c"]);
        assert_eq!(few(&["a", "b", "c", "d"]), "a, b, c, …");
    }
}
