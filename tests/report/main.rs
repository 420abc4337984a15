//! The page about a training: how logs are read, what the page shows, and that it needs nothing but itself.

mod browser;
mod command;

use nerf::report::log::Log;
use nerf::report::pictures::{LONGEST_SIDE, Pair, Pictures};
use nerf::report::views::TestViews;
use nerf::report::{Facts, Report};

/// A log with every kind of row, and a torn last line.
const FULL: &str = r#"
{"event":"start","step":0,"adapter":"llvm<pipe>","driver":"Mesa & co","left_out":["lens <model>"],"load_seconds":0.5,"compile_seconds":4}
{"step":16,"seconds":2,"loss":0.1,"psnr":10,"rays":16000,"samples":160000,"marched":640000,"learning_rate":0.01,"skipped":0}
{"step":32,"seconds":3,"loss":0.01,"psnr":20,"rays":32000,"samples":240000,"marched":640000,"learning_rate":0.005,"skipped":3}
{"step":32,"seconds":3,"eval_psnr":19.5,"views":4}
{"event":"stages","step":32,"steps":2,"stages":[{"stage":"old","ms":9}]}
{"event":"start","step":32,"adapter":"llvm<pipe>","load_seconds":0.25,"compile_seconds":1}
{"step":48,"seconds":4,"loss":0.001,"psnr":null,"rays":48000,"samples":100000,"marched":640000,"learning_rate":0,"skipped":1}
{"event":"stages","step":48,"steps":3,"stages":[{"stage":"encode <1>","ms":3},{"stage":"adam","ms":1}]}
{"event":"something new","step":48}
{"step":48,"seconds":4,"eval_psnr":21.25,"eval_ssim":0.75,"eval_seconds":2.5,"views":9}
{"step":64,"seco"#;

/// A report of a log, with hostile names.
fn report(log: &str, views: Result<TestViews, String>) -> Report {
    let facts = Facts {
        run: "runs/<script>alert(1)</script>".to_owned(),
        dataset: Some("data/<b>\"x\"&y".to_owned()),
        trained: Some(std::time::UNIX_EPOCH + std::time::Duration::from_secs(1_795_340_000)),
        settings: Some("{\"</pre><script>\": 1}".to_owned()),
        train_views: Some(7),
        ..Facts::default()
    };
    Report { facts, log: Log::parse(log), views }
}

/// `count` views of `side`² pixels, each worse than the one before.
fn views(count: usize, side: u32) -> TestViews {
    let mut views = TestViews::new(count);
    for number in 0..count {
        let photo: Vec<[f32; 3]> = (0..side * side)
            .map(|i| [(i % side) as f32 / side as f32, (i / side) as f32 / side as f32, 0.5])
            .collect();
        let off = |c: &[f32; 3]| c.map(|value| (value + 0.02 * (40.0 * value).sin()).clamp(0.0, 1.0));
        let rendered: Vec<_> = photo.iter().map(off).collect();
        let pair = Pair { size: [side, side], rendered: &rendered, photo: &photo };
        let name = format!("test/<i>{number}.png");
        let scores = [30.0 - number as f64 / 10.0, 0.9];
        views.add(&name, scores, || Pictures::new(&pair)).expect("drawn");
    }
    views
}

fn page(report: &Report) -> String {
    let html = report.html().expect("a page");
    assert_stands_alone(&html);
    html
}

/// No script, no network, and nothing from a file becomes markup.
#[track_caller]
fn assert_stands_alone(html: &str) {
    assert!(html.starts_with("<!DOCTYPE html>") && html.ends_with("</html>"), "complete");
    let rest = html.replace("http://www.w3.org/2000/svg", "");
    for foreign in
        ["http:", "https:", "//www", "<script", "<link", "@import", "url(", "<iframe", "javascript:"]
    {
        assert!(!rest.contains(foreign), "found {foreign}");
    }
    let sources = html.matches(" src=\"").count();
    assert_eq!(sources, html.matches(" src=\"data:image/").count(), "only pictures that are in the page");
    for hostile in ["<b>", "<i>", "<model>", "<pipe>", "<1>"] {
        assert!(!html.contains(hostile), "{hostile} is not escaped");
    }
}

#[test]
fn a_log_is_read_row_by_row() {
    let log = Log::parse(FULL);
    assert_eq!((log.starts.len(), log.steps.len(), log.evaluations.len(), log.damaged), (2, 3, 2, 1));
    assert_eq!(log.starts[0].left_out, ["lens <model>"]);
    assert_eq!((log.starts[1].load_seconds, log.starts[1].driver.as_deref()), (Some(0.25), None));
    assert_eq!(log.skipped(), 4);
    assert_eq!(log.steps[2].psnr, None);
    assert_eq!(log.samples_per_second(), Some(125_000.0));
    let stages = log.stages.as_ref().expect("timed");
    assert_eq!((stages.steps, stages.stages[0].stage.as_str()), (3, "encode <1>"), "the last one counts");
    assert_eq!(log.result().map(|row| row.views), Some(9));
    let lengths: Vec<_> = log.intervals().map(|interval| (interval.steps, interval.elapsed)).collect();
    assert_eq!(lengths, [(16.0, 2.0), (16.0, 1.0), (16.0, 1.0)]);
}

#[test]
fn where_the_beginning_is_missing_the_first_row_has_no_speed() {
    let rows: Vec<_> = FULL.lines().filter(|line| line.starts_with("{\"step\"")).collect();
    let log = Log::parse(&rows.join("\n"));
    assert_eq!((log.intervals().count(), log.samples_per_second()), (2, Some(170_000.0)));
    let backwards = "{\"step\":5,\"seconds\":2,\"samples\":9}\n{\"step\":4,\"seconds\":1,\"samples\":9}";
    assert_eq!(Log::parse(backwards).intervals().count(), 0);
}

#[test]
fn odd_lines_are_counted_or_passed_over() {
    let log = Log::parse(
        "\n\n[1]\n7\nnull\n{}\n{\"step\":\"many\"}\n{\"step\":-1}\n{\"step\":16,\"loss\":1e999}\n",
    );
    assert_eq!((log.damaged, log.steps.len()), (6, 0), "{log:?}");
    assert_eq!(Log::parse("{\"step\":16}\r\n{\"step\":32,\"skipped\":2}").skipped(), 2);
    let folder = tempfile::tempdir().expect("temporary folder");
    let path = folder.path().join("log.jsonl");
    assert_eq!(Log::read(&path).expect("nothing is fine"), Log::default());
    std::fs::write(&path, b"{\"step\":16,\"loss\":0.5}\n{\"adapter\":\"\xff").expect("writable");
    let log = Log::read(&path).expect("readable");
    assert_eq!((log.steps.len(), log.damaged), (1, 1));
    assert!(Log::read(folder.path()).is_err(), "a folder is no log");
}

#[test]
fn the_page_shows_the_results() {
    let html = page(&report(FULL, Ok(views(3, 16))));
    let shown = [
        "&lt;b&gt;&quot;x&quot;&amp;y</h1>",
        "2026-11-22 09:33 UTC",
        "llvm&lt;pipe&gt;",
        "Mesa &amp; co",
        "29.90 dB",
        "PSNR of 3 test views",
        "0.9000",
        ">48<",
        "125.0k",
        "4 steps were skipped",
        "1 line of the log could not be read",
        "encode &lt;1&gt;",
        "75.0 %",
        "3 timed steps up to step 48",
        "loading images, resuming at step 32",
        "evaluating all test views",
        "Trained on",
        "{&quot;&lt;/pre&gt;&lt;script&gt;&quot;: 1}",
        "nerf 0.",
    ];
    for text in shown {
        assert!(html.contains(text), "{text} is missing");
    }
    assert!(!html.contains("They are shown  ") && !html.contains(">old<"));
    let charts: Vec<_> =
        html.match_indices("aria-label=\"").map(|(at, key)| &html[at + key.len()..]).collect();
    let titles = ["PSNR", "Loss", "Samples with", "Rays per", "Samples per", "Learning rate"];
    assert_eq!(charts.len(), titles.len());
    assert!(charts.iter().zip(titles).all(|(chart, title)| chart.starts_with(title)));
    for legend in ["rays trained on", "4 test views", "9 test views"] {
        assert!(html.contains(legend), "{legend} in the legend");
    }
}

#[test]
fn the_worst_views_come_first() {
    let html = page(&report(FULL, Ok(views(3, 16))));
    let at = |text: &str| html.find(text).expect(text);
    assert!(at("test/&lt;i&gt;2.png") < at("test/&lt;i&gt;1.png"));
    assert!(at("test/&lt;i&gt;1.png") < at("test/&lt;i&gt;0.png"));
    assert_eq!(html.matches("<img ").count(), 9);
    assert!(html.contains("alt=\"error of test/&lt;i&gt;2.png\"") && html.contains("0.1 and more"));
}

#[test]
fn many_large_views_stay_small() {
    let views = views(50, 500);
    let names: Vec<_> =
        views.worst_first().iter().filter(|row| row.pictures.is_some()).map(|row| row.name.clone()).collect();
    let expected = [49, 48, 47, 46, 43, 37, 31, 25, 18, 12, 6, 0].map(|n| format!("test/<i>{n}.png"));
    assert_eq!(names.len(), 12);
    assert!(names.iter().filter(|name| expected.contains(name)).count() >= 11, "{names:?}");
    assert_eq!(names[..4], expected[..4], "the worst");
    let html = page(&report(FULL, Ok(views)));
    assert!(html.len() < 3_000_000, "{} bytes", html.len());
    assert_eq!(html.matches(&format!("width=\"{LONGEST_SIDE}\"")).count(), 36);
    assert!(html.contains("Shown are 12: the 4 worst and 8 evenly spaced ones"));
    assert!(html.contains("<details><summary>Scores of all 50 views"), "folded");
}

#[test]
fn every_odd_log_gives_a_page() {
    let left_out = || Err("not shown, the dataset <b>moved</b>".to_owned());
    let cases = [
        ("", "There is no log of steps"),
        ("{\"step\": 1", "1 line of the log"),
        ("{\"event\":\"start\"}", "There is no log of steps"),
        ("{\"step\":16}", "the dataset &lt;b&gt;moved"),
        ("{\"step\":16,\"seconds\":1e308,\"loss\":-1,\"psnr\":0,\"samples\":0}", "Course"),
        ("{\"step\":16,\"seconds\":0,\"eval_psnr\":null}", "no log of steps"),
        ("{\"event\":\"stages\",\"stages\":[{}]}", "0 timed steps"),
        ("{\"event\":\"stages\"}", "no log of steps"),
        (
            "{\"step\":32,\"seconds\":1,\"eval_psnr\":20.5,\"eval_ssim\":0.5,\"views\":1}",
            "PSNR of 1 test view<",
        ),
    ];
    for (log, expected) in cases {
        let html = page(&report(log, left_out()));
        assert!(html.contains(expected), "{expected} for {log}");
        assert!(!html.contains("NaN") && !html.contains("inf "), "{log}");
    }
    let nothing = Report { facts: Facts::default(), log: Log::default(), views: left_out() };
    page(&nothing);
    assert!(page(&report("", Ok(TestViews::new(0)))).contains("There are no test views"));
}

#[test]
fn an_older_evaluation_is_not_the_result() {
    let mut report = report(FULL, Err(String::new()));
    assert_eq!(report.result(), Some((21.25, 0.75, 9)));
    report.facts.steps = Some(64);
    assert_eq!(report.result(), None, "trained further since");
    report.facts.is_done = Some(false);
    assert!(page(&report).contains("interrupted before its end"));
}

#[test]
fn linear_light_says_how_it_is_shown() {
    let mut report = report(FULL, Ok(views(1, 8)));
    assert!(!page(&report).contains("sRGB-encoded"));
    report.facts.hdr = true;
    assert!(page(&report).contains("clamped to 0…1 and sRGB-encoded"));
}

#[test]
fn pictures_of_another_size_are_an_error() {
    let pixels = [[0.5; 3]; 6];
    let pair = Pair { size: [3, 3], rendered: &pixels, photo: &pixels };
    let error = Pictures::new(&pair).expect_err("refused").to_string();
    assert!(error.contains("3x3") && error.contains("found 6"), "{error}");
}
