//! The page about a training run: how logs are read, what the page shows, and that it needs nothing but itself.

mod browser;
mod command;

use crate::support::folder;
use glam::{DAffine3, DVec2, DVec3};
use nerf::camera::{Camera, Lens};
use nerf::capture::dataset::spread_order;
use nerf::field::renderer::View;
use nerf::run::depths::{Depths, Onlookers};
use nerf::run::log::Log;
use nerf::run::report::pictures::{LONGEST_SIDE, Pair, Pictures};
use nerf::run::report::test_views::{ScoreSummary, TestViews, ViewScores};
use nerf::run::report::{Facts, Report};

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
    let mut views = TestViews::default();
    for number in spread_order(count) {
        let photo: Vec<[f32; 3]> = (0..side * side)
            .map(|i| [(i % side) as f32 / side as f32, (i / side) as f32 / side as f32, 0.5])
            .collect();
        let off = |c: &[f32; 3]| c.map(|value| (value + 0.02 * (40.0 * value).sin()).clamp(0.0, 1.0));
        let rendered: Vec<_> = photo.iter().map(off).collect();
        let view = sphere(side);
        let depths = Some(depths_of(&view));
        let pair = Pair {
            size: [side, side],
            rendered: &rendered,
            photo: &photo,
            ignored: &[],
            depth: &view.depth,
            unit: 2.0,
        };
        let name = format!("test/<i>{number}.png");
        let scores = ViewScores { name, psnr: 30.0 - number as f64 / 10.0, ssim: 0.9, depths };
        views.add(number, scores, || Pictures::new(&pair)).expect("drawn");
    }
    views
}

/// The depths of a view from two units away from the focus, at which nine other cameras look from the side.
fn depths_of(view: &View) -> Depths {
    let camera = |angle: f64| Camera {
        width: view.width,
        height: view.height,
        focal_px: DVec2::splat(f64::from(view.width)),
        center_px: DVec2::splat(f64::from(view.width) / 2.0),
        lens: Lens::Pinhole,
        world_from_camera: DAffine3::from_rotation_y(angle)
            * DAffine3::from_translation(DVec3::new(0.0, 0.0, 2.0)),
    };
    let sides = (0..9).map(|number| camera(1.3 + 0.05 * f64::from(number)));
    let cameras: Vec<_> = [camera(0.0)].into_iter().chain(sides).collect();
    Depths::of(view, &cameras[0], &[], &Onlookers::around(DVec3::ZERO, &cameras))
}

/// A sphere two units away before nothing, and a tenth of the pixels, rows at the top, half a unit away.
fn sphere(side: u32) -> View {
    let depth = |i: u32| {
        let [x, y] = [i % side, i / side].map(|at| (at as f32 + 0.5) / side as f32 - 0.5);
        let square = 0.16 - x * x - y * y;
        match square {
            _ if 10 * (i / side) < side => 0.5,
            square if square > 0.0 => 2.0 - square.sqrt(),
            _ => 0.0,
        }
    };
    let depth: Vec<f32> = (0..side * side).map(depth).collect();
    let color = depth.iter().map(|&z| if z > 0.0 { [0.5, 0.5, 0.5, 1.0] } else { [0.0; 4] }).collect();
    View { width: side, height: side, color, depth }
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
    let folder = folder();
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
        "measuring test views at the end",
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
    let titles = [
        "PSNR",
        "Loss",
        "Samples with",
        "Rays per",
        "Samples per step",
        "Samples per ray",
        "Learning rate",
        "Opacity",
    ];
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
    assert_eq!(html.matches("<img ").count(), 12);
    assert!(html.contains("alt=\"error of test/&lt;i&gt;2.png\"") && html.contains("0.1 and more"));
}

#[test]
fn many_large_views_stay_small() {
    let views = views(50, 500);
    let names: Vec<_> = views
        .worst_first()
        .iter()
        .filter(|row| row.pictures.is_some())
        .map(|row| row.scores.name.clone())
        .collect();
    let expected = [49, 48, 47, 46, 43, 37, 31, 25, 18, 12, 6, 0].map(|n| format!("test/<i>{n}.png"));
    assert_eq!(names.len(), 12);
    assert!(names.iter().filter(|name| expected.contains(name)).count() >= 11, "{names:?}");
    assert_eq!(names[..4], expected[..4], "the worst");
    let html = page(&report(FULL, Ok(views)));
    assert!(html.len() < 3_000_000, "{} bytes", html.len());
    assert_eq!(html.matches(&format!("width=\"{LONGEST_SIDE}\"")).count(), 48);
    assert!(html.contains("Shown are 12: the 4 worst and 8 evenly spaced ones"));
    assert!(html.contains("<details><summary>Scores of 50 views"), "folded");
}

#[test]
fn every_odd_log_gives_a_page() {
    let left_out = || Err("not shown, the dataset <b>moved</b>".to_owned());
    let cases = [
        ("", "There is no log of steps"),
        ("{\"step\": 1", "1 line of the log"),
        ("{\"event\":\"start\"}", "There is no log of steps"),
        ("{\"step\":16}", "the dataset &lt;b&gt;moved"),
        ("{\"step\":16,\"seconds\":1e308,\"loss\":-1,\"psnr\":0,\"samples\":0}", "Training curves"),
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
    assert!(page(&report("", Ok(TestViews::default()))).contains("There are no test views"));
}

#[test]
fn an_older_evaluation_is_not_the_result() {
    let mut report = report(FULL, Err(String::new()));
    let logged = ScoreSummary { psnr: 21.25, ssim: 0.75, views: 9, left_out: 0, near_share: None };
    assert_eq!(report.summary(), Some(logged));
    report.facts.steps = Some(64);
    assert_eq!(report.summary(), None, "trained further since");
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
    let pair =
        Pair { size: [3, 3], rendered: &pixels, photo: &pixels, ignored: &[], depth: &[1.0; 9], unit: 1.0 };
    let error = Pictures::new(&pair).expect_err("refused").to_string();
    assert!(error.contains("3x3") && error.contains("found 6"), "{error}");
    let pixels = [[0.5; 3]; 9];
    let pair =
        Pair { size: [3, 3], rendered: &pixels, photo: &pixels, ignored: &[], depth: &[1.0; 8], unit: 1.0 };
    let error = Pictures::new(&pair).expect_err("refused").to_string();
    assert!(error.contains("found 8"), "{error}");
}

/// The colours of a picture in a page, by pixel.
fn decoded(address: &str) -> image::RgbImage {
    let data = address.split_once("base64,").expect("a data address").1;
    let bytes = base64::Engine::decode(&base64::engine::general_purpose::STANDARD, data).expect("base64");
    image::load_from_memory(&bytes).expect("a picture").to_rgb8()
}

#[test]
fn depth_is_bright_where_it_is_near_and_black_where_nothing_is() {
    let pixels = [[0.5; 3]; 5];
    let pair = Pair {
        size: [5, 1],
        rendered: &pixels,
        photo: &pixels,
        ignored: &[],
        depth: &[0.0, 1e-6, 1.0, 2.0, 1e9],
        unit: 2.0,
    };
    let pictures = Pictures::new(&pair).expect("drawn");
    let depth = decoded(&pictures.depth);
    let colors: Vec<_> = (0..5).map(|x| depth[(x, 0)].0).collect();
    assert_eq!([colors[0], colors[1], colors[4]], [[0; 3], [0xfd, 0xe7, 0x25], [0x44, 0x01, 0x54]]);
    assert_eq!(colors[3], [0x21, 0x91, 0x8c], "the unit is in the middle");
    let brightness = |color: &[u8; 3]| color.iter().map(|&value| u32::from(value)).sum::<u32>();
    assert!(colors[1..].is_sorted_by_key(|color| std::cmp::Reverse(brightness(color))), "{colors:?}");
}

#[test]
fn what_masks_ignore_is_no_error() {
    let (rendered, photo) = ([[0.5; 3]; 6], [[0.5; 3], [1.0; 3], [1.0; 3], [0.5; 3], [1.0; 3], [0.5; 3]]);
    let ignored = [false, false, true, true, true, true];
    let pair = Pair {
        size: [6, 1],
        rendered: &rendered,
        photo: &photo,
        ignored: &ignored,
        depth: &[1.0; 6],
        unit: 1.0,
    };
    let mut pictures = Pictures::new(&pair).expect("drawn");
    let error = decoded(&pictures.error);
    let colors: Vec<_> = (0..6).map(|x| error[(x, 0)].0).collect();
    assert_eq!(colors[..2], [[0, 0, 4], [0xfc, 0xff, 0xa4]], "none, and the largest");
    assert_eq!(colors[2..], [[0x5c; 3], [0x5c; 3], [0x94; 3], [0x94; 3]], "stripes");
    let page_of = |pictures| {
        let mut views = TestViews::default();
        let scores = ViewScores { name: "a".to_owned(), psnr: 20.0, ssim: 0.9, depths: None };
        views.add(0, scores, || Ok(pictures)).expect("drawn");
        page(&report(FULL, Ok(views)))
    };
    assert!(pictures.has_ignored && page_of(pictures.clone()).contains("striped grey"));
    pictures.has_ignored = false;
    assert!(!page_of(pictures).contains("striped grey"));
}

#[test]
fn fog_is_warned_of() {
    let foggy = page(&report(FULL, Ok(views(3, 20))));
    assert!(foggy.contains("<strong>Fog: </strong>") && foggy.contains("10 %</dd>"), "a tenth of the pixels");
    assert!(foggy.contains("where 1 is the distance from the camera") && foggy.contains("depth, 1 = 2.000"));
    let with = |scores: ViewScores| {
        let mut views = TestViews::default();
        views.add(0, scores, || anyhow::bail!("nothing to see")).expect_err("says so");
        page(&report(FULL, Ok(views)))
    };
    let scores = ViewScores { name: "clear.png".to_owned(), psnr: 30.0, ssim: 0.9, depths: None };
    let untold = with(scores.clone());
    assert!(untold.contains("median depth") && untold.contains("is not told: the optical axes do not cross"));
    assert!(!untold.contains("Fog: "));
    let empty = View { width: 1, height: 1, color: vec![[0.0; 4]], depth: vec![0.0] };
    let clear = with(ViewScores { depths: Some(depths_of(&empty)), ..scores });
    assert!(
        clear.contains("no pixel shows anything") && clear.contains("0 %</dd>") && !clear.contains("Fog: ")
    );
}

#[test]
fn what_was_left_out_is_said() {
    let mut views = views(3, 8);
    views.left_out = 2;
    let html = page(&report(FULL, Ok(views)));
    assert!(html.contains("PSNR of 3 of 5 test views") && html.contains("2 more were left out"), "{html}");
    assert!(html.contains("nerf eval RUN DATASET"));
    let log = "{\"step\":32,\"seconds\":1,\"eval_psnr\":20.5,\"eval_ssim\":0.5,\"views\":1,\"views_left_out\":6,\"near_share\":0.25}";
    let html = page(&report(log, Err(String::new())));
    assert!(
        html.contains("PSNR of 1 of 7 test views") && html.contains("25 %</dd>") && html.contains("Fog: ")
    );
}
