//! Random numbers: the same integers on the device and in the reference.

use super::inputs::{SEED, STEP, quiet_step};
use super::probe::Probe;
use super::{CheckResult, CheckedAdapter};
use crate::verify::reference::random::{pcg, random_u32, uniform};
use anyhow::Result;

const COUNT: usize = 4096;

/// Integers and floats of the kernels' random numbers, to the last bit.
///
/// # Errors
/// When the device was lost or refuses the kernel.
pub fn random_numbers(adapter: &CheckedAdapter) -> Result<CheckResult> {
    let mut result = CheckResult::new("random numbers", 0.0, "integers are exact");
    // Halves of 16 bits, which floats hold exactly.
    let body = format!(
        "let i = u32(input(0u).x);\n\
         let mixed = pcg(i * 1048573u);\n\
         let drawn = random_u32({stream}u, i * 7919u, i % 11u);\n\
         output(0u, vec4<f32>(vec4(mixed & 0xffffu, mixed >> 16u, drawn & 0xffffu, drawn >> 16u)));\n\
         output(1u, vec4(random_f32({stream}u, i, 3u), 0.0, 0.0, 0.0));",
        stream = quiet_step().stream
    );
    let inputs: Vec<_> = (0..COUNT).map(|i| [[i as f32, 0.0, 0.0, 0.0]]).collect();
    let outputs = Probe { needs: "random", variants: &[], body: &body }.evaluate::<1, 2>(adapter, &inputs)?;
    for (i, [halves, [float, ..]]) in outputs.into_iter().enumerate() {
        let index = i as u32;
        let mixed = pcg(index.wrapping_mul(1_048_573));
        let drawn = random_u32(SEED, STEP, index.wrapping_mul(7919), index % 11);
        for (name, [low, high], want) in
            [("pcg", [halves[0], halves[1]], mixed), ("random_u32", [halves[2], halves[3]], drawn)]
        {
            let got = f64::from(high) * 65536.0 + f64::from(low);
            result.value(got, f64::from(want), 1.0, || format!("{name}, number {i}"));
        }
        let want = f64::from(uniform(random_u32(SEED, STEP, index, 3)));
        result.value(f64::from(float), want, 1.0, || format!("random_f32, number {i}"));
    }
    Ok(result)
}
