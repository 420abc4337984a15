//! Charts: what is drawn for good data and for odd data.

use nerf::support::chart::{Axis, Chart, Mark, Series};

fn chart(x: Axis, y: Axis, series: Vec<Series>) -> Chart {
    Chart { title: "A <title> & more".to_owned(), x, y, series }
}

fn svg(chart: &Chart) -> String {
    let svg = chart.svg(480, 300).expect("drawn");
    assert!(svg.starts_with("<svg ") && svg.trim_end().ends_with("</svg>"), "{svg}");
    assert!(svg.contains("viewBox=\"0 0 1920 1200\"") && svg.contains("width=\"480\""), "{svg}");
    assert!(!svg.contains("NaN") && !svg.contains("inf\""), "{svg}");
    svg
}

/// The texts of a picture, without the heading and the names of the axes.
fn ticks(svg: &str) -> Vec<String> {
    let texts = svg.split("<text ").skip(1).map(|rest| {
        let text = &rest[rest.find('>').expect("closed") + 1..];
        text[..text.find('<').expect("closed")].trim().to_owned()
    });
    texts.filter(|text| text.chars().next().is_some_and(|c| c.is_ascii_digit() || c == '−')).collect()
}

fn one(points: &[(f64, f64)]) -> Vec<Series> {
    vec![Series::new("one", Mark::Line, points.to_vec())]
}

#[test]
fn ticks_are_round_and_labelled() {
    let linear = chart(Axis::linear("s"), Axis::linear("1/s"), one(&[(0.0, 0.0), (60.0, 186_000.0)]));
    let labels = ticks(&svg(&linear));
    for label in ["0", "20", "40", "60", "50 k", "100 k", "150 k"] {
        assert!(labels.iter().any(|found| found == label), "{label} in {labels:?}");
    }
    let log = chart(Axis::linear("s"), Axis::log("loss"), one(&[(0.0, 0.2), (0.25, 3e-5)]));
    let labels = ticks(&svg(&log));
    for label in ["10⁻⁴", "10⁻³", "10⁻²", "10⁻¹", "0.05", "0.15", "0.25"] {
        assert!(labels.iter().any(|found| found == label), "{label} in {labels:?}");
    }
    let within_a_decade = chart(Axis::log("x"), Axis::log("y"), one(&[(0.011, 2e7), (0.012, 8e7)]));
    let labels = ticks(&svg(&within_a_decade));
    for label in ["0.0110", "0.0114", "0.0120", "3·10⁷", "5·10⁷"] {
        assert!(labels.iter().any(|found| found == label), "{label} in {labels:?}");
    }
    let signed = chart(Axis::linear("x"), Axis::linear("y"), one(&[(-1e-9, -0.2), (1e-9, 0.2)]));
    let labels = ticks(&svg(&signed));
    for label in ["−0.1", "0.1", "0", "1.0·10⁻⁹", "−0.5·10⁻⁹"] {
        assert!(labels.iter().any(|found| found == label), "{label} in {labels:?}");
    }
}

#[test]
fn odd_data_give_a_picture() {
    let all: [&[(f64, f64)]; 9] = [
        &[],
        &[(1.0, 2.0)],
        &[(1.0, 2.0), (1.0, 2.0)],
        &[(0.0, 0.0)],
        &[(f64::NAN, 1.0), (2.0, f64::INFINITY), (f64::NEG_INFINITY, -1.0)],
        &[(-1.0, -1.0), (0.0, 0.0)],
        &[(f64::MIN, f64::MAX), (f64::MAX, f64::MIN), (0.0, f64::MIN_POSITIVE)],
        &[(1.0, 1.0 + 1e-15), (1.0 + 1e-15, 1.0), (1.0, 1.0)],
        &[(5e-324, 5e-324), (1e-300, 1e300)],
    ];
    let axes = [Axis::linear("linear"), Axis::log("log")];
    for points in all {
        for (x, y) in axes.iter().flat_map(|x| axes.iter().map(move |y| (x, y))) {
            for mark in [Mark::Line, Mark::Points, Mark::LinePoints] {
                let series = Series::new("odd", mark, points.to_vec());
                let both = vec![series.clone(), series.dashed()];
                let found = svg(&chart(x.clone(), y.clone(), both));
                assert!(ticks(&found).len() < 60, "{:?}", ticks(&found));
            }
        }
    }
    let empty = svg(&chart(Axis::log("x"), Axis::log("y"), vec![]));
    assert!(empty.contains("no data"), "{empty}");
    let lone = svg(&chart(Axis::log("x"), Axis::log("y"), one(&[(3.0, 4.0)])));
    assert!(lone.contains("<circle") && !lone.contains("no data"), "a single point shows: {lone}");
}

#[test]
fn lines_are_interrupted_where_a_point_has_no_place() {
    let gap = [(0.0, 1.0), (1.0, 2.0), (2.0, f64::NAN), (3.0, 2.0), (4.0, 1.0)];
    let color = "stroke=\"#0072B2\"";
    let lines = |points: &[(f64, f64)]| {
        svg(&chart(Axis::linear("x"), Axis::linear("y"), one(points))).matches(color).count()
    };
    assert_eq!((lines(&gap), lines(&gap[..2])), (2, 1));
}

#[test]
fn a_long_series_stays_small() {
    let points: Vec<_> = (0..200_000).map(|i| (f64::from(i), (f64::from(i) * 0.7).sin())).collect();
    let text = svg(&chart(Axis::linear("x"), Axis::linear("y"), one(&points)));
    assert!(text.len() < 60_000, "{} bytes", text.len());
}

#[test]
fn names_are_escaped_and_fitted() {
    let name = "<b>\"&'\u{0}\u{1b}</b>".to_owned() + &"long ".repeat(50);
    let series = vec![Series::new(&name, Mark::Line, vec![(1.0, 1.0)]); 2];
    let text = svg(&chart(Axis::linear("<x>"), Axis::linear("a & b"), series));
    assert!(text.contains("aria-label=\"A &lt;title&gt; &amp; more\""), "{text}");
    assert!(text.contains("&lt;b&gt;&quot;&amp;") && text.contains('…') && !text.contains("<b>"), "{text}");
    assert!(!text.contains('\u{0}') && !text.contains('\u{1b}'));
}

#[test]
fn sizes_without_room_are_refused() {
    let chart = chart(Axis::linear("x"), Axis::linear("y"), vec![]);
    for (width, height) in [(0, 300), (300, 10), (10_000, 300), (u32::MAX, u32::MAX)] {
        let error = chart.svg(width, height).expect_err("refused").to_string();
        assert!(error.contains("120 to 8192"), "{error}");
    }
    assert!(chart.svg(120, 120).is_ok() && chart.svg(8192, 8192).is_ok());
}
