//! From the bytes of a file to strict JSON text, forgiving what capture tools and hands do to it.

use anyhow::{Context, Result, bail, ensure};

/// Decodes UTF-8, with or without a byte-order mark, and UTF-16 with one.
pub(super) fn decode(bytes: &[u8]) -> Result<String> {
    let utf16 = |from_bytes: fn([u8; 2]) -> u16| {
        ensure!(
            bytes.len().is_multiple_of(2),
            "the UTF-16 text has an odd number of bytes; save the file as UTF-8"
        );
        let units = bytes[2..].chunks_exact(2).map(|pair| from_bytes([pair[0], pair[1]]));
        let text: Result<String, _> = char::decode_utf16(units).collect();
        text.context("expected UTF-16 text, as the byte-order mark says; save the file as UTF-8")
    };
    match bytes {
        [0xff, 0xfe, ..] => utf16(u16::from_le_bytes),
        [0xfe, 0xff, ..] => utf16(u16::from_be_bytes),
        _ => match std::str::from_utf8(bytes) {
            Ok(text) => Ok(text.to_owned()),
            Err(error) => {
                let line = 1 + bytes[..error.valid_up_to()].iter().filter(|&&byte| byte == b'\n').count();
                bail!("expected UTF-8 text, found other bytes in line {line}; save the file as UTF-8")
            }
        },
    }
}

/// Refuses what is no JSON document at all, as it comes out of a failed download or copy.
pub(super) fn refuse_strangers(text: &str) -> Result<()> {
    let start = text.trim_start();
    ensure!(!start.is_empty(), "expected a JSON object with a list `frames`, found an empty file");
    ensure!(
        !start.starts_with("version https://git-lfs"),
        "expected JSON, found a Git LFS pointer; fetch the file itself with `git lfs pull`"
    );
    ensure!(!start.starts_with('<'), "expected JSON, found a web page or XML; download the raw file");
    Ok(())
}

/// Turns `//` and `/* */` comments and trailing commas into blanks, keeping every line and column, and
/// puts numbers that JSON cannot express (`NaN`, `-Infinity`, `1e999`) between quotes, for the reader of
/// the key to judge.
pub(super) fn strict(text: &str) -> String {
    let mut output = String::with_capacity(text.len());
    let mut rest = text;
    // The last byte that means something, and a comma that has nothing behind it yet.
    let mut before = b'[';
    let mut open_comma = None;
    while let Some(&first) = rest.as_bytes().first() {
        let token = &rest[..token_length(rest)];
        rest = &rest[token.len()..];
        if token.starts_with("//") || token.starts_with("/*") {
            output.extend(token.chars().map(|c| if c == '\n' { '\n' } else { ' ' }));
            continue;
        }
        if first.is_ascii_whitespace() {
            output.push_str(token);
            continue;
        }
        match (first, open_comma.take()) {
            (b'}' | b']', Some(at)) => output.replace_range(at.., &output[at..].replacen(',', " ", 1)),
            (b',', _) if !matches!(before, b'[' | b'{' | b',' | b':') => open_comma = Some(output.len()),
            _ => {}
        }
        before = first;
        if is_word(first) && token.parse::<f64>().is_ok_and(|number| !number.is_finite()) {
            output.push('"');
            output.push_str(token);
            output.push('"');
        } else {
            output.push_str(token);
        }
    }
    output
}

fn is_word(byte: u8) -> bool {
    byte.is_ascii_alphanumeric() || matches!(byte, b'+' | b'-' | b'.' | b'_')
}

/// Length of the comment, string, word, white space or single character that a text starts with.
fn token_length(text: &str) -> usize {
    let bytes = text.as_bytes();
    let run = |is_part: fn(u8) -> bool| bytes.iter().take_while(|&&byte| is_part(byte)).count();
    match bytes {
        [b'/', b'/', ..] => text.find('\n').unwrap_or(text.len()),
        [b'/', b'*', ..] => text[2..].find("*/").map_or(text.len(), |end| end + 4),
        [b'"', ..] => string_length(bytes),
        [first, ..] if is_word(*first) => run(is_word),
        [first, ..] if first.is_ascii_whitespace() => run(|byte| byte.is_ascii_whitespace()),
        _ => text.chars().next().map_or(0, char::len_utf8),
    }
}

/// Length of the string literal at the start, quotes included.
fn string_length(bytes: &[u8]) -> usize {
    let mut is_escaped = false;
    for (at, &byte) in bytes.iter().enumerate().skip(1) {
        match byte {
            _ if is_escaped => is_escaped = false,
            b'\\' => is_escaped = true,
            b'"' => return at + 1,
            _ => {}
        }
    }
    bytes.len()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_and_columns_are_kept() {
        let text = "{ // one\n/* two\n */ \"a // b\": [1, 2 , /* é */ ],\r\n}";
        assert_eq!(strict(text), "{       \n      \n    \"a // b\": [1, 2           ] \r\n}");
    }

    #[test]
    fn only_trailing_commas_go() {
        for text in ["[,]", "{,}", "[1,,]", "[1,,2]", "{\"a\":,}", "\"[1,]\"", "/* x"] {
            assert_eq!(strict(text), text.replace("/* x", "    "), "{text}");
        }
        assert_eq!(strict("[[1,],{\"a\":2,},]"), "[[1 ],{\"a\":2 } ]");
    }

    #[test]
    fn non_numbers_are_quoted() {
        let text = "[NaN, -Infinity, inf, 1e999, -1e9999, 1e9, \"NaN\", nano, true]";
        let expected = "[\"NaN\", \"-Infinity\", \"inf\", \"1e999\", \"-1e9999\", 1e9, \"NaN\", nano, true]";
        assert_eq!(strict(text), expected);
    }

    #[test]
    fn encodings_are_recognised() {
        let encode = |units: fn(u16) -> [u8; 2]| "\u{feff}{é}".encode_utf16().flat_map(units).collect();
        let (little, big): (Vec<u8>, Vec<u8>) = (encode(u16::to_le_bytes), encode(u16::to_be_bytes));
        assert_eq!(decode(&little).expect("UTF-16"), "{é}");
        assert_eq!(decode(&big).expect("UTF-16"), "{é}");
        assert_eq!(decode("{é}".as_bytes()).expect("UTF-8"), "{é}");
        let message = decode(b"{\n\xe9}").expect_err("Latin-1").to_string();
        assert!(message.contains("line 2"), "{message}");
        assert!(decode(b"\xff\xfe{").is_err() && decode(b"\xff\xfe\x00\xd8").is_err());
    }
}
