//! OpenCV's lens on its own: where a point is imaged, and the slopes that Newton's method follows back.

use super::draw::Random;
use super::probe::Probe;
use super::{Subject, Tally};
use crate::kernels::part;
use crate::reference::lens::Distortion;
use anyhow::Result;
use glam::DVec2;

/// Distorted points and their Jacobian, of lenses far stronger than any that are built.
///
/// # Errors
/// When the device was lost or refuses the kernel.
pub fn lens_model(subject: &Subject) -> Result<Tally> {
    let mut tally =
        Tally::new("lens: points and slopes", 1e-6, "sixteen roundings of polynomials of degree 9");
    let body = "let at = lens_distort(input(0u).xy, input(1u), input(0u).zw);\n\
                output(0u, vec4(at.point, at.d_x));\n\
                output(1u, vec4(at.d_y, 0.0, 0.0));";
    let mut random = Random::new(44);
    let inputs: Vec<_> = (0..4000).map(|_| input(&mut random)).collect();
    let parts = [part!("lens/opencv.wgsl")];
    let outputs = Probe { parts: &parts, body }.evaluate::<2, 2>(subject, &inputs)?;
    for (input, [first, second]) in inputs.iter().zip(outputs) {
        let [[x, y, p1, p2], k] = input.map(|row| row.map(f64::from));
        let (lens, point) = (Distortion { k, p: [p1, p2] }, DVec2::new(x, y));
        // With everything positive a sum is the size of its terms.
        let (size, corner) = (Distortion { k: k.map(f64::abs), p: [p1.abs(), p2.abs()] }, point.abs());
        let case = || format!("{lens:?} at {point}");
        let got = DVec2::new(first[0].into(), first[1].into());
        for (got, (want, size)) in both(got, lens.distort(point), size.distort(corner)) {
            tally.value(got, want, size, case);
        }
        let rows = [[first[2], first[3]], [second[0], second[1]]];
        let (want, size) = (lens.jacobian(point).transpose(), size.jacobian(corner).transpose());
        for (row, got) in rows.into_iter().enumerate() {
            let got = DVec2::new(got[0].into(), got[1].into());
            for (got, (want, size)) in both(got, want.col(row), size.col(row)) {
                tally.value(got, want, size, case);
            }
        }
    }
    Ok(tally)
}

/// A point and p1, p2; k1 to k4.
fn input(random: &mut Random) -> [[f32; 4]; 2] {
    let mut number = |most: f64| random.number(-most, most) as f32;
    [
        [number(1.5), number(1.5), number(0.1), number(0.1)],
        [number(0.6), number(0.3), number(0.1), number(0.05)],
    ]
}

/// Both components: what is, what should be, and its size.
fn both(got: DVec2, want: DVec2, size: DVec2) -> [(f64, (f64, f64)); 2] {
    [(got.x, (want.x, size.x)), (got.y, (want.y, size.y))]
}
