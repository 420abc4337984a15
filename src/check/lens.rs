//! Lenses on their own: what Newton's method follows back, and the sine and cosine of angles.

use super::draw::Random;
use super::probe::Probe;
use super::{Subject, Tally};
use crate::kernels::{CAMERA, RAY, SINE};
use crate::reference::lens::{Distortion, Fisheye};
use anyhow::Result;
use glam::DVec2;

/// All of it.
///
/// # Errors
/// When the device was lost or refuses a kernel.
pub fn lens_models(subject: &Subject) -> Result<Vec<Tally>> {
    Ok(vec![points_and_slopes(subject)?, sines(subject)?])
}

/// What OpenCV's models add to a point, and their slopes, for coefficients far stronger than any that are built.
fn points_and_slopes(subject: &Subject) -> Result<Tally> {
    let mut tally =
        Tally::new("lens: points and slopes", 1e-6, "sixteen roundings of polynomials of degree 9");
    let body = "let at = opencv_bend(input(0u).xy, input(1u), input(0u).zw);\n\
                output(0u, vec4(at.shift, at.d_x));\n\
                output(1u, vec4(at.d_y, fisheye_bend(abs(input(0u).x), input(1u))));";
    let mut random = Random::new(44);
    let inputs: Vec<_> = (0..4000).map(|_| input(&mut random)).collect();
    let outputs = Probe { parts: &[CAMERA, RAY], body }.evaluate::<2, 2>(subject, &inputs)?;
    for (input, [first, second]) in inputs.iter().zip(outputs) {
        let [[x, y, p1, p2], k] = input.map(|row| row.map(f64::from));
        let (lens, point) = (Distortion { k, p: [p1, p2] }, DVec2::new(x, y));
        // With everything positive a sum is the size of its terms.
        let (size, corner) = (Distortion { k: k.map(f64::abs), p: [p1.abs(), p2.abs()] }, point.abs());
        let case = || format!("{lens:?} at {point}");
        let (got, want) = (vector([first[0], first[1]]), lens.distort(point) - point);
        compare(&mut tally, got, want, size.distort(corner), case);
        let rows = [[first[2], first[3]], [second[0], second[1]]];
        let (want, size) = (lens.jacobian(point).transpose(), size.jacobian(corner).transpose());
        for (row, got) in rows.into_iter().enumerate() {
            compare(&mut tally, vector(got), want.col(row), size.col(row), case);
        }
        let (lens, theta) = (Fisheye { k }, x.abs());
        let size = Fisheye { k: k.map(f64::abs) };
        let want = DVec2::new(lens.radius(theta) - theta, lens.slope(theta));
        let size = DVec2::new(size.radius(theta), size.slope(theta));
        compare(&mut tally, vector([second[2], second[3]]), want, size, || format!("{lens:?} at {theta}"));
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

/// Compares both components.
fn compare(tally: &mut Tally, got: DVec2, want: DVec2, size: DVec2, case: impl Fn() -> String) {
    tally.value(got.x, want.x, size.x, &case);
    tally.value(got.y, want.y, size.y, &case);
}

fn vector([x, y]: [f32; 2]) -> DVec2 {
    DVec2::new(x.into(), y.into())
}

/// Sine and cosine over more than a turn.
fn sines(subject: &Subject) -> Result<Tally> {
    let mut tally =
        Tally::new("sine and cosine", 1e-7, "the last sum of a series rounds, and its argument did");
    let body = "output(0u, vec4(sine_cosine(input(0u).x), sine_cosine(input(0u).y)));";
    let angle = |i: i32| (4.0 * f64::from(i) / 10_000.0) as f32;
    let inputs: Vec<_> = (0..=10_000).map(|i| [[angle(i), -angle(i), 0.0, 0.0]]).collect();
    let outputs = Probe { parts: &[SINE], body }.evaluate::<1, 1>(subject, &inputs)?;
    for ([input], [got]) in inputs.iter().zip(&outputs) {
        let (sine, cosine) = f64::from(input[0]).sin_cos();
        tally.each(&format!("{}", input[0]), got, &[sine, cosine, -sine, cosine], |_| 1.0);
    }
    Ok(tally)
}
