//! `nerf bench` and the studies of `benches/studies` on whatever adapter there is: small, and everything they write read
//! again.

mod medium;
mod order;
mod stiff;
#[allow(dead_code, reason = "the tests ask for parts of it, and not for its `main`")]
#[path = "../../benches/studies/main.rs"]
mod studies;

use crate::program::{SMOKE, number, object, place, quietly, text};
use clap::Parser;
use predicates::str::contains;
use serde_json::Value;
use std::fs;
use std::path::Path;

/// What a study finds, with the arguments of its command line.
fn study(args: &[&str]) -> anyhow::Result<studies::Outcome> {
    let args = studies::Args::parse_from([&["studies"], args].concat());
    args.study.expect("a study").run(None)
}

fn json(path: &Path) -> Value {
    serde_json::from_str(&fs::read_to_string(path).expect("a file")).expect("JSON")
}

/// The header, and the values of each row.
fn csv(path: &Path) -> (String, Vec<Vec<String>>) {
    let text = fs::read_to_string(path).expect("a file");
    let mut lines = text.lines();
    let header = lines.next().expect("a header").to_owned();
    (header, lines.map(|line| line.split(',').map(str::to_owned).collect()).collect())
}

fn numbers(value: &Value, key: &str) -> Vec<f64> {
    value.as_array().expect("an array").iter().map(|entry| number(&entry[key])).collect()
}

fn is_picture(path: &Path, words: &[&str]) {
    let picture = fs::read_to_string(path).expect("a picture");
    assert!(picture.starts_with("<svg") && picture.trim_end().ends_with("</svg>"));
    for word in words {
        assert!(picture.contains(word), "{word} is missing in {}", path.display());
    }
}

#[test]
fn training_is_measured_over_time() {
    let here = place("training");
    let (toys, out, wide) = (here.join("toys"), here.join("out"), here.join("wide.json"));
    quietly(&["generate", "toys", "--views", "24", "--size", "16", "--samples", "1", "--out", text(&toys)])
        .assert()
        .success();
    let smoke = here.join("smoke.json");
    fs::copy(SMOKE, &smoke).expect("copied");
    fs::write(&wide, fs::read_to_string(SMOKE).expect("text").replace("\"width\": 16", "\"width\": 32"))
        .expect("writable");
    let configs = ["--config", text(&smoke), "--config", text(&wide), "--seeds", "2"];
    let args = ["bench", "training", text(&toys), "--out", text(&out), "--steps", "40", "--views", "1"];
    let summary = object(&[&args[..], &configs].concat());
    assert_eq!(summary["configs"].as_array().map(Vec::len), Some(2));
    assert!(number(&summary["configs"][0]["load_seconds"]) > 0.0 && summary["adapter"].is_string());

    let whole = json(&out.join("training.json"));
    let runs = whole["runs"].as_array().expect("runs");
    let names: Vec<_> = runs.iter().map(|run| (run["config"].as_str(), run["seed"].as_u64())).collect();
    let of = |config, seed| (Some(config), Some(seed));
    assert_eq!(names, [of("smoke", 0), of("smoke", 1), of("wide", 0), of("wide", 1)]);
    let (header, rows) = csv(&out.join("training.csv"));
    assert_eq!(header, "config,seed,step,seconds,loss,eval_psnr,eval_ssim,views");
    for run in runs {
        assert!(number(&run["compile_seconds"]) > 0.0 && number(&run["evaluate_seconds"]) > 0.0);
        assert!(number(&run["samples_per_second"]) > 0.0 && run["steps"] == 40);
        let width = if run["config"] == "wide" { 32 } else { 16 };
        assert_eq!(run["settings"]["network"]["width"], width);
        let points = run["points"].as_array().expect("points");
        let (seconds, steps) = (numbers(&run["points"], "seconds"), numbers(&run["points"], "step"));
        assert!(seconds.is_sorted() && steps.is_sorted() && points.len() >= 3, "{seconds:?}");
        let last = points.last().expect("an end");
        assert_eq!((&last["step"], &last["views"]), (&Value::from(40), &run["views"]));
        assert!(number(&last["eval_psnr"]) > 5.0 && last["eval_psnr"] == run["psnr"]);
        assert_eq!(points[points.len() - 2]["views"], 1, "the end of the curve");
        let of_run = |row: &&Vec<String>| {
            run["config"] == row[0].as_str() && run["seed"].as_u64() == row[1].parse().ok()
        };
        assert_eq!(rows.iter().filter(of_run).count(), points.len());
        let stages = run["stages"].as_array().expect("stages").len();
        assert!(stages == 0 || (stages > 8 && number(&run["timed_steps"]) > 0.0), "{stages}");
    }
    assert!(rows.iter().all(|row| row.len() == 8 && row[3].parse::<f64>().is_ok()));
    is_picture(&out.join("training.svg"), &["smoke, seed 0", "wide, seed 1", "seconds of training"]);
}

#[test]
fn runs_that_cannot_be_compared_are_refused_at_once() {
    let here = place("refused");
    let (toys, out) = (here.join("toys"), here.join("out"));
    quietly(&["generate", "toys", "--views", "4", "--size", "8", "--samples", "1", "--out", text(&toys)])
        .assert()
        .success();
    let args = ["bench", "training", text(&toys), "--out", text(&out), "--steps", "1"];
    let fails = |further: &[&str], code: i32, message: &str| {
        quietly(&[&args[..], further].concat()).assert().code(code).stderr(contains(message));
        assert!(!out.exists());
    };
    fails(&["--config", SMOKE, "--config", SMOKE], 1, "two configs are called 'smoke'");
    fails(&["--config", SMOKE, "--config", "nothing.json"], 1, "nothing.json");
    fails(&["--seeds", "2", "--seed", "1"], 2, "cannot be used with");
    fails(&["--seeds", "0"], 2, "--seeds");
    quietly(&["bench"]).assert().code(2).stderr(contains("training"));
}

#[test]
fn quadrature_converges_as_the_mathematics_says() {
    let out = place("quadrature");
    let args = ["quadrature", "--out", text(&out), "--rays", "24", "--repeats", "1"];
    let summary = study(&args).expect("a result").json;
    let order = |medium: &str, sum: &str, quantity: &str, of: &str| -> f64 {
        let orders = summary["orders"].as_array().expect("orders");
        let found = orders.iter().find(|order| {
            let is_curve = order["medium"] == medium && order["transmittance"] == sum;
            is_curve && order["early_stop"] == false && order["quantity"] == quantity
        });
        number(&found.expect("a curve")[of]["slope"])
    };
    for of in ["kernel", "reference"] {
        assert!((order("bump", "exclusive", "color", of) - 2.0).abs() < 0.2, "{of}");
        assert!((order("slab", "exclusive", "color", of) - 1.0).abs() < 0.2, "{of}");
        for quantity in ["color", "opacity"] {
            assert!((order("bump", "inclusive", quantity, of) - 1.0).abs() < 0.2, "{of}, {quantity}");
        }
    }
    let rows = json(&out.join("quadrature.json"))["rows"].clone();
    let rows = rows.as_array().expect("rows");
    assert_eq!(rows.len(), 3 * 4 * 9);
    for row in rows {
        let (error, exact) = (number(&row["color_error"]), number(&row["color_error_f64"]));
        assert!((error - exact).abs() < 1e-5, "the kernel is not the reference: {row}");
        assert!(number(&row["color_rounding"]) < 1e-5);
        assert!(row["seconds"].is_null() || number(&row["seconds"]) > 0.0);
        assert!(number(&row["kept_per_ray"]) <= number(&row["steps"]));
    }
    let stops = |row: &&Value| row["medium"] == "wall" && row["steps"] == 1024 && row["early_stop"] == true;
    let stopped = rows.iter().find(stops).expect("a row");
    assert!(number(&stopped["kept_per_ray"]) < 700.0, "nothing behind the wall: {stopped}");
    assert_eq!(csv(&out.join("quadrature.csv")).1.len(), rows.len());
    is_picture(&out.join("quadrature.svg"), &["smooth bump", "inclusive, early stop", "RMS error"]);
}

#[test]
fn equations_differ_as_printed() {
    let out = place("equations");
    let result = study(&["equations", "--out", text(&out)]).expect("a result").json;
    let slabs = result["slabs"].as_array().expect("slabs");
    assert_eq!(slabs.len(), 3 * 11);
    for slab in slabs {
        let (exact, exclusive, inclusive) = (number(&slab["exact"]), &slab["exclusive"], &slab["inclusive"]);
        assert!((number(&exclusive["kernel"]) - exact).abs() < 3e-6, "{slab}");
        assert!((number(&inclusive["kernel"]) - number(&inclusive["reference"])).abs() < 3e-6, "{slab}");
    }
    let thick = slabs.iter().find(|slab| slab["optical_depth"] == 50.0 && slab["samples"] == 8);
    assert!(number(&thick.expect("a slab")["inclusive"]["kernel"]) < 0.002);
    let gradients = result["gradients"].as_array().expect("gradients");
    let errors = |of: &str| gradients.iter().map(|family| number(&family[of]["error"])).fold(0.0, f64::max);
    assert!(errors("kernel") < 5e-5 && errors("textbook") > 0.1);
    let broken = |of: &str| gradients.iter().map(|family| number(&family[of]["not_finite"])).sum::<f64>();
    assert!(broken("kernel") == 0.0 && broken("textbook") > 0.0);
    let printed = fs::read_to_string(out.join("equations.md")).expect("Markdown");
    assert!(printed.contains("| samples |") && printed.contains("stiff wall behind fog"));

    let vectors = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/vectors/composite_inclusive.json");
    let golden = study(&["equations", "--vectors", vectors]).expect("a result").text;
    assert!(golden.contains("long ray") && golden.contains("not finite"));
    let missing = study(&["equations", "--vectors", "none.json"]).expect_err("no such file");
    assert!(format!("{missing:#}").contains("none.json"));
}
