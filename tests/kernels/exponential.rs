//! The exponentials whose error must not depend on the driver, through a kernel of their own.

use nerf::kernels::Part;
use nerf::reference::composite;

use crate::bench::{Bench, Setup};

const EXP: Part = ("common/exp.wgsl", include_str!("../../shaders/common/exp.wgsl"));

/// Largest relative error.
const BOUND: f64 = 2e-7;

/// `expression` of `x` (and of `y`) for all inputs.
fn evaluate(expression: &str, inputs: &[[f32; 2]]) -> Vec<f32> {
    let mut bench = Bench::new(&Setup::tiny());
    let text = format!(
        "var<storage, read> test_inputs: array<vec2<f32>>;\n\
         var<storage, read_write> test_outputs: array<f32>;\n\
         @compute @workgroup_size(64)\n\
         fn main(@builtin(global_invocation_id) id: vec3<u32>) {{\n\
             if id.x >= arrayLength(&test_inputs) {{ return; }}\n\
             let x = test_inputs[id.x].x;\n\
             let y = test_inputs[id.x].y;\n\
             test_outputs[id.x] = {expression};\n\
         }}\n"
    );
    // Buffers are multiples of 16 bytes.
    let mut padded = inputs.to_vec();
    padded.resize(inputs.len().next_multiple_of(4), [1.0; 2]);
    bench.0.workspace.add(bench.0.gpu.storage_with("test_inputs", &padded).expect("inputs"));
    bench.0.workspace.add(bench.0.gpu.storage::<f32>("test_outputs", padded.len()).expect("outputs"));
    let kernel = bench.plan.generated_kernel(&bench.gpu, "test", &[EXP], &[], text).expect("a kernel");
    let bound = bench.workspace.bind(&bench.gpu, &kernel, &[]).expect("bindings");
    bench.run([&nerf::gpu::pass::Stage::fixed(bound, padded.len().div_ceil(64), 1)]);
    bench.read("test_outputs", inputs.len())
}

/// Prints and bounds the worst relative error.
fn assert_relative(name: &str, inputs: &[[f32; 2]], got: &[f32], want: impl Fn(f64, f64) -> f64, bound: f64) {
    let mut worst = (0.0, [0.0; 2], 0.0, 0.0);
    for (&input, &got) in inputs.iter().zip(got) {
        let want = want(f64::from(input[0]), f64::from(input[1]));
        let error = (f64::from(got) - want).abs() / want.abs();
        assert!(got.is_finite(), "{name} at {input:?}: {got}");
        if error > worst.0 {
            worst = (error, input, f64::from(got), want);
        }
    }
    let (error, at, got, want) = worst;
    println!("{name}: worst relative error {error:.2e} at {at:?}");
    assert!(error <= bound, "{name} at {at:?}: got {got:e}, want {want:e}, relative error {error:e}");
}

fn linear(low: f64, high: f64) -> Vec<[f32; 2]> {
    let count = 40_000;
    (0..=count).map(|i| [(low + (high - low) * f64::from(i) / f64::from(count)) as f32, 1.0]).collect()
}

#[test]
fn exp_is_accurate() {
    let inputs = linear(-87.0, 88.0);
    let got = evaluate("exp_accurate(x)", &inputs);
    assert_relative("exp_accurate", &inputs, &got, |x, _| x.exp(), BOUND);
    let near_zero: Vec<_> = linear(-1e-3, 1e-3);
    let got = evaluate("exp_accurate(x)", &near_zero);
    assert_relative("exp_accurate near 0", &near_zero, &got, |x, _| x.exp(), BOUND);
    let beyond = [-87.5, -100.0, -1e30, 89.0, 1e30, 0.0].map(|x| [x, 1.0]);
    let got = evaluate("exp_accurate(x)", &beyond);
    assert_eq!(got[..3], [0.0; 3]);
    assert!(got[3] == got[4] && got[4].is_finite() && got[5] == 1.0, "{got:?}");
}

#[test]
fn opacity_is_accurate() {
    let inputs: Vec<[f32; 2]> = linear(-30.0, 2.0).iter().map(|[x, _]| [10f32.powf(*x), 1.0]).collect();
    let want = |tau: f64, _| composite::opacity(tau);
    assert_relative("opacity", &inputs, &evaluate("opacity(x)", &inputs), want, BOUND);
    let around: Vec<_> = linear(0.3, 0.4);
    assert_relative("opacity at the switch", &around, &evaluate("opacity(x)", &around), want, BOUND);
    assert_eq!(evaluate("opacity(x)", &[[0.0, 0.0]]), [0.0]);
    let passing = linear(0.0, 80.0);
    let got = evaluate("passing(x, opacity(x))", &passing);
    assert_relative("passing", &passing, &got, |tau, _| (-tau).exp(), BOUND);
}

#[test]
fn optical_depth_is_accurate() {
    // The exponent s + ln δ is rounded to f32: half a unit in its last place is an error of τ.
    let mut inputs = Vec::new();
    for s in linear(-30.0, 15.0).iter().step_by(97) {
        inputs.extend([1e-6, 1e-3, 0.03, 1.0, 2.5].map(|delta| [s[0], delta]));
    }
    let want = |s: f64, delta: f64| composite::optical_depth(s, delta).min(100.0);
    let got = evaluate("optical_depth(x, y)", &inputs);
    let bound = 45.0 * f64::from(f32::EPSILON) + BOUND;
    assert_relative("optical_depth", &inputs, &got, want, bound);
    let extremes = [[1.0, 0.0], [1.0, -1.0], [1e30, 1.0], [-1e30, 1.0], [80.0, 1e-30]];
    let got = evaluate("optical_depth(x, y)", &extremes);
    assert_eq!((got[0], got[1], got[3]), (0.0, 0.0, 0.0));
    assert!((got[2] - 100.0).abs() < 1e-4 && got[4].is_finite(), "{got:?}");
}
