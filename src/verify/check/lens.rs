//! Lenses on their own: what Newton's method follows back, and the sine and cosine of angles.

use super::inputs::Random;
use super::probe::Probe;
use super::{CheckResult, CheckedAdapter};
use crate::camera::Lens;
use crate::verify::reference::lens::{self, Distortion, Fisheye};
use anyhow::Result;
use glam::{DVec2, DVec3};

/// All of it.
///
/// # Errors
/// When the device was lost or refuses a kernel.
pub fn lens_models(adapter: &CheckedAdapter) -> Result<Vec<CheckResult>> {
    Ok(vec![points_and_slopes(adapter)?, undistorted_points(adapter)?, sines(adapter)?])
}

/// What OpenCV's models add to a point, and their slopes, for coefficients far stronger than any that are built.
fn points_and_slopes(adapter: &CheckedAdapter) -> Result<CheckResult> {
    let mut result =
        CheckResult::new("lens: points and slopes", 1e-6, "sixteen roundings of polynomials of degree 9");
    let body = "let at = opencv_bend(input(0u).xy, input(1u), input(0u).zw);\n\
                output(0u, vec4(at.shift, at.d_x));\n\
                output(1u, vec4(at.d_y, fisheye_bend(abs(input(0u).x), input(1u))));";
    let mut random = Random::new(44);
    let inputs: Vec<_> = (0..4000).map(|_| input(&mut random)).collect();
    let outputs = Probe { needs: "camera", variants: &[], body }.evaluate::<2, 2>(adapter, &inputs)?;
    for (input, [first, second]) in inputs.iter().zip(outputs) {
        let [[x, y, p1, p2], k] = input.map(|row| row.map(f64::from));
        let (lens, point) = (Distortion { k, p: [p1, p2] }, DVec2::new(x, y));
        // With everything positive a sum is the size of its terms.
        let (size, corner) = (Distortion { k: k.map(f64::abs), p: [p1.abs(), p2.abs()] }, point.abs());
        let case = || format!("{lens:?} at {point}");
        let (got, want) = (vector([first[0], first[1]]), lens.distort(point) - point);
        compare(&mut result, got, want, size.distort(corner), case);
        let rows = [[first[2], first[3]], [second[0], second[1]]];
        let (want, size) = (lens.jacobian(point).transpose(), size.jacobian(corner).transpose());
        for (row, got) in rows.into_iter().enumerate() {
            compare(&mut result, vector(got), want.col(row), size.col(row), case);
        }
        let (lens, theta) = (Fisheye { k }, x.abs());
        let size = Fisheye { k: k.map(f64::abs) };
        let want = DVec2::new(lens.radius(theta) - theta, lens.slope(theta));
        let size = DVec2::new(size.radius(theta), size.slope(theta));
        compare(&mut result, vector([second[2], second[3]]), want, size, || format!("{lens:?} at {theta}"));
    }
    Ok(result)
}

/// Ordinary lenses, strong ones, and ones that fold within the image.
const LENSES: [Lens; 10] = [
    Lens::OpenCv { k: [0.05, -0.08, 0.02, 0.0], p: [1e-3, -5e-4] },
    Lens::OpenCv { k: [-0.27, 0.11, -0.03, 0.004], p: [2e-3, 1e-3] },
    Lens::OpenCv { k: [-0.36, 0.18, -0.045, 0.0045], p: [-2e-3, 3e-3] },
    Lens::OpenCv { k: [-0.45, 0.05, 0.0, 0.0], p: [1e-3, 2e-3] },
    Lens::OpenCv { k: [0.35, 0.12, 0.01, 0.0], p: [-3e-3, 2e-3] },
    Lens::Fisheye { k: [0.0; 4] },
    Lens::Fisheye { k: [-0.02, 0.003, -0.0004, 0.00002] },
    Lens::Fisheye { k: [-0.1, 0.0, 0.0, 0.0] },
    Lens::Fisheye { k: [-0.1, 0.08, -0.022, 0.0019] },
    Lens::Fisheye { k: [0.1, 0.02, 0.0, 0.0] },
];
/// Size and focal lengths, OpenCV's and the fisheye's, of the image that round trips cover, in pixels.
const IMAGE: [f64; 2] = [1000.0, 750.0];
const FOCAL_PX: [f64; 2] = [810.0, 310.0];

/// Points all over an image through the inverse of the lens and back through the reference's lens, in pixels.
fn undistorted_points(adapter: &CheckedAdapter) -> Result<CheckResult> {
    let mut result = CheckResult::new(
        "lens: round trips, pixels",
        1e-4,
        "points and angles round; the image is 1000 pixels wide",
    );
    let body = "var camera: Camera;\n\
                camera.radial = input(1u);\n\
                camera.tangential = input(2u).xy;\n\
                camera.rim = input(2u).z;\n\
                var seen = opencv_ray(camera, input(0u).xy);\n\
                if input(2u).w > 0.0 {\n\
                    seen = fisheye_ray(camera, input(0u).xy);\n\
                }\n\
                output(0u, vec4(seen.direction, select(0.0, 1.0, seen.exists)));";
    for lens in LENSES {
        let (focal_px, inputs) = image_of(lens);
        let outputs = Probe { needs: "camera", variants: &[], body }.evaluate::<3, 1>(adapter, &inputs)?;
        let mut seen = 0;
        for (input, [[x, y, z, exists]]) in inputs.iter().zip(outputs) {
            let plane = vector([input[0][0], input[0][1]]);
            let case = || format!("{lens:?} at {plane}");
            // Where rounding decides whether there is a ray, either answer will do.
            let [inside, outside] = [1.03, 0.97].map(|scale| lens::ray(&lens, plane * scale).is_some());
            if inside != outside {
                continue;
            }
            result.holds((exists > 0.0) == inside, || format!("{}: is there a ray?", case()));
            if inside && exists > 0.0 {
                seen += 1;
                let back = lens::image(&lens, DVec3::from_array([x, y, z].map(f64::from)));
                result.error(focal_px * (back - plane).length(), || format!("{}: back at {back}", case()));
            }
        }
        result.holds(seen > 1000, || format!("{lens:?}: only {seen} rays"));
    }
    Ok(result)
}

/// Every 11th pixel of an image, as points on the lens's plane, with its coefficients and its rim.
fn image_of(lens: Lens) -> (f64, Vec<[[f32; 4]; 3]>) {
    let (k, p, is_fisheye) = match lens {
        Lens::OpenCv { k, p } => (k, p, 0.0),
        Lens::Fisheye { k } => (k, [0.0; 2], 1.0),
        _ => ([0.0; 4], [0.0; 2], 0.0),
    };
    let focal_px = FOCAL_PX[is_fisheye as usize];
    let rim = lens.rim().unwrap_or_default();
    let narrow = |values: [f64; 4]| values.map(|value| value as f32);
    let [columns, rows] = IMAGE.map(|pixels| (pixels / 11.0) as u32);
    let point = |index: u32| {
        let pixel = DVec2::new(f64::from(index % columns), f64::from(index / columns)) * 11.0 + 0.5;
        let plane = (pixel - 0.5 * DVec2::from_array(IMAGE)) / focal_px;
        [narrow([plane.x, plane.y, 0.0, 0.0]), narrow(k), narrow([p[0], p[1], rim, is_fisheye])]
    };
    (focal_px, (0..columns * rows).map(point).collect())
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
fn compare(result: &mut CheckResult, got: DVec2, want: DVec2, size: DVec2, case: impl Fn() -> String) {
    result.value(got.x, want.x, size.x, &case);
    result.value(got.y, want.y, size.y, &case);
}

fn vector([x, y]: [f32; 2]) -> DVec2 {
    DVec2::new(x.into(), y.into())
}

/// Sine and cosine over more than a turn.
fn sines(adapter: &CheckedAdapter) -> Result<CheckResult> {
    let mut result =
        CheckResult::new("sine and cosine", 1e-7, "the last sum of a series rounds, and its argument did");
    let body = "output(0u, vec4(sine_cosine(input(0u).x), sine_cosine(input(0u).y)));";
    let angle = |i: i32| (4.0 * f64::from(i) / 10_000.0) as f32;
    let inputs: Vec<_> = (0..=10_000).map(|i| [[angle(i), -angle(i), 0.0, 0.0]]).collect();
    let outputs = Probe { needs: "sine", variants: &[], body }.evaluate::<1, 1>(adapter, &inputs)?;
    for ([input], [got]) in inputs.iter().zip(&outputs) {
        let (sine, cosine) = f64::from(input[0]).sin_cos();
        result.each(&format!("{}", input[0]), got, &[sine, cosine, -sine, cosine], |_| 1.0);
    }
    Ok(result)
}
