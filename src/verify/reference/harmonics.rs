//! Real spherical harmonics up to degree 4: what the colour network knows about the viewing direction.
//!
//! Order, signs (Condon–Shortley phase) and normalisation are those of Müller et al. 2022's implementation.

use glam::DVec3;

/// Number of terms.
pub const TERMS: usize = 16;

/// The terms at a unit direction, orthonormal over the sphere; band `b` fills `b²..(b+1)²`.
pub fn harmonics(direction: DVec3) -> [f64; TERMS] {
    let DVec3 { x, y, z } = direction;
    let (xx, yy, zz) = (x * x, y * y, z * z);
    [
        0.282_094_791_773_878_14,
        -0.488_602_511_902_919_9 * y,
        0.488_602_511_902_919_9 * z,
        -0.488_602_511_902_919_9 * x,
        1.092_548_430_592_079_2 * x * y,
        -1.092_548_430_592_079_2 * y * z,
        0.946_174_695_757_56 * zz - 0.315_391_565_252_52,
        -1.092_548_430_592_079_2 * x * z,
        0.546_274_215_296_039_6 * (xx - yy),
        0.590_043_589_926_643_5 * y * (yy - 3.0 * xx),
        2.890_611_442_640_554 * x * y * z,
        0.457_045_799_464_465_7 * y * (1.0 - 5.0 * zz),
        0.373_176_332_590_115_4 * z * (5.0 * zz - 3.0),
        0.457_045_799_464_465_7 * x * (1.0 - 5.0 * zz),
        1.445_305_721_320_277 * z * (xx - yy),
        0.590_043_589_926_643_5 * x * (3.0 * yy - xx),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    /// `∫ Y_i Y_j dω = δ_ij`, by a midpoint rule: exact in azimuth, error below 10⁻⁵ in z.
    #[test]
    fn terms_are_orthonormal() {
        let (rings, spokes) = (1000, 16);
        let mut products = [[0.0; TERMS]; TERMS];
        for ring in 0..rings {
            let z = (f64::from(ring) + 0.5) / f64::from(rings) * 2.0 - 1.0;
            for spoke in 0..spokes {
                let azimuth = 2.0 * PI * f64::from(spoke) / f64::from(spokes);
                let radius = (1.0 - z * z).sqrt();
                let y = harmonics(DVec3::new(radius * azimuth.cos(), radius * azimuth.sin(), z));
                for i in 0..TERMS {
                    for j in 0..TERMS {
                        products[i][j] += y[i] * y[j] * 4.0 * PI / f64::from(rings * spokes);
                    }
                }
            }
        }
        for (i, row) in products.iter().enumerate() {
            for (j, product) in row.iter().enumerate() {
                let expected = if i == j { 1.0 } else { 0.0 };
                assert!((product - expected).abs() < 2e-5, "{i} {j} {product}");
            }
        }
    }
}
