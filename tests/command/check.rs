//! `nerf check`: its table, its JSON, and what it says of files that it cannot pass.

use crate::program::{answer, nerf};
use crate::support::folder;
use assert_cmd::Command;
use nerf::config::Transmittance;
use nerf::verify::check::inputs::Random;
use nerf::verify::check::stress_rays::StressRay;
use nerf::verify::reference::vectors::{GoldenFile, NOT_FINITE};
use predicates::prelude::*;
use predicates::str::contains;
use serde_json::{Value, json};
use std::fs;
use std::path::PathBuf;
use tempfile::TempDir;

fn check(args: &[&str]) -> Command {
    let mut command = nerf();
    command.arg("check").args(args);
    if let Ok(adapter) = std::env::var("NERF_ADAPTER") {
        command.args(["--adapter", &adapter]);
    }
    command
}

/// A file of a few stress rays, changed by `change`.
fn vectors(folder: &TempDir, change: impl FnOnce(&mut Value)) -> String {
    let rays = StressRay::many(&mut Random::new(7), 60, 33);
    let file: GoldenFile = StressRay::golden(Transmittance::Inclusive, 1000, &rays);
    let mut value = serde_json::to_value(&file).expect("numbers");
    change(&mut value);
    let path: PathBuf = folder.path().join("rays.json");
    fs::write(&path, value.to_string()).expect("writable");
    path.to_string_lossy().into_owned()
}

#[test]
fn every_kernel_passes_and_json_says_so() {
    let result = answer(&mut check(&["--quiet"]), 0);
    let keys: Vec<_> = result.as_object().expect("an object").keys().map(String::as_str).collect();
    assert_eq!(keys, ["adapter", "pass", "worst", "kernels", "rays"]);
    assert_eq!((&result["pass"], &result["rays"]), (&json!(true), &json!([])));
    let kernels = result["kernels"].as_array().expect("a list");
    let number = |kernel: &Value, key: &str| kernel[key].as_f64().expect("a number");
    let worst = kernels.iter().fold(0.0, |worst: f64, kernel| worst.max(number(kernel, "worst")));
    assert_eq!(number(&result, "worst"), worst);
    assert!(kernels.len() > 20 && worst > 0.0);
    for kernel in kernels {
        let name = kernel["name"].as_str().expect("a name");
        assert!(number(kernel, "cases") > 100.0 && kernel["pass"] == true, "{name}");
        assert!(number(kernel, "worst") <= number(kernel, "bound"), "{name}");
    }
}

/// Every variant that runs on any adapter, in a table.
#[test]
fn fallbacks_can_be_forced() {
    let forced = ["--accumulation", "exchange", "--memory", "buffers", "--product", "1"];
    let path = "compare-exchange gradients (asked for), tensors in buffers (asked for), matrix products of 1 row per \
                thread (asked for)\n";
    check(&forced)
        .assert()
        .code(0)
        .stdout(
            contains(path).and(contains("hash grid: scattered gradients")).and(contains("bounds are kept")),
        )
        .stdout(contains("FAIL").not());
}

#[test]
fn golden_rays_of_a_file_pass_whatever_the_order_of_magnitude() {
    let here = folder();
    let file = vectors(&here, |_| {});
    let result = answer(&mut check(&["--vectors", &file, "--quiet"]), 0);
    assert_eq!((&result["pass"], &result["kernels"]), (&json!(true), &json!([])));
    let rays = result["rays"].as_array().expect("a list");
    assert_eq!(rays.len(), 60);
    assert!(rays.iter().all(|ray| ray["finite"] == true && ray["error"].as_f64() <= Some(5e-5)));
    check(&["--vectors", &file]).assert().code(0).stdout(contains("all 60 rays").and(contains("Inclusive")));
    let none = vectors(&here, |file| file["rays"] = json!([]));
    let result = answer(&mut check(&["--vectors", &none, "--quiet"]), 0);
    assert_eq!((&result["pass"], &result["worst"], &result["rays"]), (&json!(true), &json!(0.0), &json!([])));
}

#[test]
fn a_wrong_expectation_fails() {
    let here = folder();
    let file = vectors(&here, |file| {
        let gradient = &mut file["rays"][20]["expect"]["dL_ds"][0];
        *gradient = json!(gradient.as_f64().expect("a number") + 1.0);
    });
    let result = answer(&mut check(&["--vectors", &file]), 1);
    assert_eq!(result["pass"], false);
    assert!(result["worst"].as_f64() > Some(1e-3) && result["worst"].as_f64() <= Some(NOT_FINITE));
    assert_eq!(result["worst"], result["rays"][20]["error"]);
    let name = result["rays"][20]["name"].as_str().expect("a name").to_owned();
    check(&["--vectors", &file])
        .assert()
        .code(1)
        .stdout(contains(name).and(contains("FAIL")).and(contains("dL_ds")))
        .stderr(contains("1 of 60 rays"));
}

#[test]
fn files_that_are_none_of_golden_rays_are_explained() {
    let here = folder();
    let fails = |file: &str, parts: &[&str]| {
        let mut assert = check(&["--vectors", file]).assert().code(1).stderr(contains("panicked").not());
        for part in parts {
            assert = assert.stderr(contains(*part));
        }
    };
    let broken = |change: fn(&mut Value), parts: &[&str]| fails(&vectors(&here, change), parts);
    broken(|file| file["transmittance"] = json!("both"), &["transmittance", "both", "exclusive"]);
    broken(|file| file["rays_in_batch"] = json!(0), &["rays_in_batch is 0"]);
    broken(|file| file["rays_in_batch"] = json!(1e12), &["rays_in_batch", "u32"]);
    broken(|file| file["rays"][3]["s"] = json!("none"), &["ray 3 ", "s: invalid type", "none"]);
    broken(|file| file["rays"][20]["delta"] = json!([1.0]), &["ray 20 ", "delta has 1 elements, expected"]);
    broken(|file| file["rays"][20]["s"][2] = json!(1e39), &["ray 20 ", "s holds 1e39", "single precision"]);
    broken(|file| file["rays"][20]["c"][1] = json!([1.0, null, 0.0]), &["ray 20 ", "c[1][1]", "null"]);
    broken(|file| file["rays"][5]["expect"]["dL_dc"] = json!({}), &["ray 5 ", "expect.dL_dc", "sequence"]);
    broken(
        |file| {
            let expect = file["rays"][5]["expect"].as_object_mut().expect("an object");
            expect.remove("weights");
        },
        &["ray 5 ", "expect: missing field `weights`"],
    );
    broken(|file| file["rays"][5]["name"] = json!(7), &["ray 5 ", "name: invalid type"]);
    broken(|file| file["rays"] = json!(7), &["rays: invalid type"]);
    let text = here.path().join("text");
    fs::write(&text, "no rays").expect("writable");
    fails(&text.to_string_lossy(), &["text", "is not a file of golden rays", "line 1"]);
    fails("nowhere.json", &["cannot read the golden rays in nowhere.json"]);
}

#[test]
fn what_cannot_be_forced_is_explained() {
    check(&["--accumulation", "often"]).assert().code(2).stderr(contains("exchange"));
    check(&["--product", "3"]).assert().code(2).stderr(contains("shared"));
    let listing = nerf().arg("adapters").assert();
    if !String::from_utf8_lossy(&listing.get_output().stdout).contains("llvmpipe") {
        return;
    }
    // llvmpipe with vectors of four has subgroups of four.
    let mut command = check(&["--product", "shared", "--adapter", "llvmpipe"]);
    command
        .env("LP_NATIVE_VECTOR_WIDTH", "128")
        .assert()
        .code(1)
        .stderr(contains("subgroups of a multiple of 8"));
}
