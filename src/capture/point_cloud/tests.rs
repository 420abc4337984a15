use super::*;
use std::fs::write;
use tempfile::TempDir;

const POINTS: [[f32; 3]; 3] = [[1.0, -2.0, 0.5], [4.0, 5.5, -6.0], [0.0, 1e-3, 7.0]];

/// What a file of these bytes has.
fn read(bytes: &[u8]) -> Result<Vec<DVec3>> {
    let folder = TempDir::new().expect("a folder");
    let path = folder.path().join("cloud.ply");
    write(&path, bytes).expect("written");
    positions(&path)
}

/// A header with faces before the vertices, which have a colour before and a list after their places.
fn header(format: &str) -> String {
    format!(
        "ply\r\nformat {format} 1.0\r\ncomment by hand\r\nelement face 1\r\nproperty list uchar int vertex_indices\r\n\
         element vertex 3\r\nproperty uchar red\r\nproperty float x\r\nproperty float32 y\r\nproperty float z\r\n\
         property list uchar short seen_by\r\nend_header\r\n"
    )
}

fn binary(format: &str, is_big: bool) -> Vec<u8> {
    let number = |value: f32| if is_big { value.to_be_bytes() } else { value.to_le_bytes() };
    let mut bytes = header(format).into_bytes();
    bytes.push(3);
    bytes.extend([0; 12]);
    for (index, point) in POINTS.into_iter().enumerate() {
        bytes.push(200);
        bytes.extend(point.into_iter().flat_map(number));
        bytes.push(index as u8);
        bytes.extend([7; 4][..2 * index].iter());
    }
    bytes
}

fn expected() -> Vec<DVec3> {
    POINTS.map(|point| DVec3::from_array(point.map(f64::from))).to_vec()
}

#[test]
fn every_encoding_is_read() {
    let text = header("ascii") + "3 0 1 2\r\n200 1 -2 0.5 0\r\n200 4 5.5 -6 1 9\r\n200 0 1e-3 7 2 9 9\r\n";
    let found = read(text.as_bytes()).expect("read");
    assert!(found.iter().zip(expected()).all(|(a, b)| a.distance(b) < 1e-6) && found.len() == 3, "{found:?}");
    for (format, is_big) in [("binary_little_endian", false), ("binary_big_endian", true)] {
        assert_eq!(read(&binary(format, is_big)).expect("read"), expected(), "{format}");
    }
}

#[test]
fn of_many_points_some_are_read() {
    let mut bytes = b"ply\nformat binary_little_endian 1.0\nelement vertex 120001\nproperty double x\nproperty double y\n\
        property double z\nend_header\n"
        .to_vec();
    (0..120_001u32)
        .for_each(|index| bytes.extend([index, 0, 0].into_iter().flat_map(|v| f64::from(v).to_le_bytes())));
    let found = read(&bytes).expect("read");
    assert_eq!((found.len(), found[1].x, found[40_000].x), (40_001, 3.0, 120_000.0));
}

#[test]
fn what_is_no_cloud_is_an_error() {
    let sizes = "element vertex 99999999999999999999\n";
    let endless = "ply\nformat ascii 1.0\nelement a 18446744073709551615\nelement vertex 0\nproperty int x\n";
    for (text, expected) in [
        ("", "too early"),
        ("solid\n", "begins with `ply`"),
        ("ply\nformat ascii 1.0\nend_header\n", "an element `vertex`"),
        ("ply\nformat utf 1.0\nend_header\n", "found `utf`"),
        ("ply\nelement vertex 1\nproperty half x\nend_header\n", "found `half`"),
        ("ply\nelement vertex 1\nproperty float x\nend_header\n", "no line `format`"),
        (&format!("ply\n{sizes}"), "count"),
        (&format!("{endless}end_header\n"), "x, y and z"),
        (&format!("ply\n{}", "comment\n".repeat(2000)), "end_header"),
    ] {
        let error = format!("{:#}", read(text.as_bytes()).expect_err(text));
        assert!(error.contains(expected), "{error}");
    }
    // Cut or damaged anywhere, it is an error or fewer points, and never a panic.
    let whole = binary("binary_big_endian", true);
    for length in 0..whole.len() {
        assert!(read(&whole[..length]).is_err() || length > whole.len() - 5, "{length}");
        let mut damaged = whole.clone();
        damaged[length] ^= 0xff;
        let _ = read(&damaged);
    }
}
