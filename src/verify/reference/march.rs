//! Where a ray is sampled.
//!
//! All lengths are in box space, `t` from the ray's origin. The shortest step is
//! `dt_min = √3/steps · 2^−(C−1)`: `steps` of them make a diagonal of the inner cube. With the near end `t_near`
//! of the ray inside the box, and one `jitter` in `[0, 1)` per ray, sample `i` is at
//!
//! ```text
//! one cascade:  t_i = t_near + (i + jitter) dt_min                 dt_i = dt_min
//! more:         t_i = t(u_i),  u_i = u(t_near) + jitter + i        dt_i = t(u_i + 1) − t(u_i)
//!
//! u(t) = t/dt_min                               up to t1 = dt_min/κ
//!      = u(t1) + ln(t/t1)/ln(1 + κ)             up to t2 = dt_max/κ
//!      = u(t2) + (t − t2)/dt_max                beyond;   dt_max = 1/R
//! ```
//!
//! so that steps grow with the distance (Müller et al. 2022, appendix E.1), from `dt_min` to a cell of the
//! coarsest cascade. Samples end at `t_far` or after `max_steps`, counting the skipped ones; one is skipped if
//! its occupancy cell is empty.

use glam::DVec3;

use super::occupancy::{OccupancyShape, is_set};

/// Growth of a step per distance, `κ`.
pub const CONE: f64 = 1.0 / 256.0;

/// How rays are sampled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct March {
    /// Shape of the occupancy grid.
    pub shape: OccupancyShape,
    /// Steps per diagonal of the inner cube.
    pub steps: u32,
    /// How many times longer all steps are, at least 1: `dt_min`, `dt_max` and `κ` are multiplied by it.
    pub scale: f64,
    /// `κ`, usually [`CONE`]; without effect for a single cascade, and 0 makes all steps equal.
    pub cone: f64,
    /// Distance from the origin before which nothing is sampled.
    pub near: f64,
    /// Steps per ray, counting the skipped ones, after which it ends.
    pub max_steps: u32,
}

/// A ray in box space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoxRay {
    /// Where the camera is.
    pub origin: DVec3,
    /// Unit direction.
    pub direction: DVec3,
}

/// One sample of a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MarchSample {
    /// `i`: which of the ray's steps.
    pub step: u32,
    /// Distance from the origin.
    pub t: f64,
    /// Position in box space.
    pub position: DVec3,
    /// Step in units of the inner cube's side, `dt 2^(C−1)`: what compositing takes as `δ`.
    pub delta: f64,
}

/// `[t_near, t_far]` of a ray in the box `[0, 1]³`, from `near` on; `None` if it misses.
///
/// Slab test: the ray is in the box where it is between both planes of each axis. Along an axis that
/// the direction does not have, the origin decides.
pub fn box_interval(ray: BoxRay, near: f64) -> Option<[f64; 2]> {
    let (mut t_near, mut t_far) = (near.max(0.0), f64::INFINITY);
    for axis in 0..3 {
        let (o, d) = (ray.origin[axis], ray.direction[axis]);
        if d == 0.0 {
            if !(0.0..=1.0).contains(&o) {
                return None;
            }
        } else {
            let (t0, t1) = ((0.0 - o) / d, (1.0 - o) / d);
            t_near = t_near.max(t0.min(t1));
            t_far = t_far.min(t0.max(t1));
        }
    }
    (t_near < t_far && t_far.is_finite()).then_some([t_near, t_far])
}

impl March {
    /// Shortest step in box space, `scale · √3/steps · 2^−(C−1)`.
    pub fn dt_min(&self) -> f64 {
        self.scale * self.base_dt_min()
    }

    fn base_dt_min(&self) -> f64 {
        3.0_f64.sqrt() / f64::from(self.steps.max(1)) * self.shape.side(0)
    }

    fn growth(&self) -> f64 {
        self.scale * self.cone
    }

    /// Longest step in box space: a cell of the coarsest cascade, `1/R`, but at least the shortest.
    pub fn dt_max(&self) -> f64 {
        self.scale * (1.0 / f64::from(self.shape.resolution.max(1))).max(self.base_dt_min())
    }

    /// Whether all steps are equal.
    pub fn is_uniform(&self) -> bool {
        self.shape.cascades <= 1 || self.cone <= 0.0
    }

    /// Step count `u(t)` from the origin to the distance `t`.
    pub fn u_from_t(&self, t: f64) -> f64 {
        let (dt_min, dt_max) = (self.dt_min(), self.dt_max());
        if self.is_uniform() {
            return t / dt_min;
        }
        let [t1, t2] = [dt_min / self.growth(), dt_max / self.growth()];
        let [u1, u2] = self.bends();
        if t < t1 {
            t / dt_min
        } else if t < t2 {
            u1 + (t / t1).ln() / self.growth().ln_1p()
        } else {
            u2 + (t - t2) / dt_max
        }
    }

    /// Distance at a step count, the inverse of [`Self::u_from_t`].
    pub fn t_from_u(&self, u: f64) -> f64 {
        let (dt_min, dt_max) = (self.dt_min(), self.dt_max());
        if self.is_uniform() {
            return u * dt_min;
        }
        let [t1, t2] = [dt_min / self.growth(), dt_max / self.growth()];
        let [u1, u2] = self.bends();
        if u < u1 {
            u * dt_min
        } else if u < u2 {
            t1 * ((u - u1) * self.growth().ln_1p()).exp()
        } else {
            t2 + (u - u2) * dt_max
        }
    }

    /// `u(t1)` and `u(t2)`.
    fn bends(&self) -> [f64; 2] {
        let u1 = 1.0 / self.growth();
        [u1, u1 + (self.dt_max() / self.dt_min()).ln() / self.growth().ln_1p()]
    }

    /// `t_i` and `dt_i` of step `i`, for a ray that enters at `t_near`.
    pub fn step(&self, t_near: f64, jitter: f64, i: u32) -> [f64; 2] {
        let steps = f64::from(i) + jitter;
        if self.is_uniform() {
            let dt = self.dt_min();
            [t_near + steps * dt, dt]
        } else {
            let u = self.u_from_t(t_near) + steps;
            let t = self.t_from_u(u);
            [t, self.t_from_u(u + 1.0) - t]
        }
    }

    /// The samples of a ray, front to back. `words` are the bits of the occupancy grid.
    pub fn samples(&self, ray: BoxRay, jitter: f64, words: &[u32]) -> Vec<MarchSample> {
        let mut samples = Vec::new();
        let Some([t_near, t_far]) = box_interval(ray, self.near) else {
            return samples;
        };
        for i in 0..self.max_steps {
            let [t, dt] = self.step(t_near, jitter, i);
            if t >= t_far {
                break;
            }
            let position = ray.origin + t * ray.direction;
            if is_set(words, self.shape.cell(position)) {
                samples.push(MarchSample { step: i, t, position, delta: dt / self.shape.side(0) });
            }
        }
        samples
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn march(cascades: u32, resolution: u32, steps: u32) -> March {
        March {
            shape: OccupancyShape { cascades, resolution },
            steps,
            scale: 1.0,
            cone: CONE,
            near: 0.0,
            max_steps: 1024,
        }
    }

    fn along_x(x: f64) -> BoxRay {
        BoxRay { origin: DVec3::new(x, 0.5, 0.25), direction: DVec3::X }
    }

    #[test]
    fn intervals_by_hand() {
        assert_eq!(box_interval(along_x(-1.0), 0.0), Some([1.0, 2.0]));
        assert_eq!(box_interval(along_x(0.25), 0.0), Some([0.0, 0.75]));
        assert_eq!(box_interval(along_x(0.25), 0.5), Some([0.5, 0.75]));
        assert_eq!(box_interval(along_x(1.5), 0.0), None);
        let diagonal = BoxRay { origin: DVec3::splat(-1.0), direction: DVec3::ONE };
        assert_eq!(box_interval(diagonal, 0.0), Some([1.0, 2.0]));
        for (origin, direction) in
            [(DVec3::new(0.5, 2.0, 0.5), DVec3::X), (DVec3::splat(0.5), DVec3::ZERO), (DVec3::NAN, DVec3::X)]
        {
            assert_eq!(box_interval(BoxRay { origin, direction }, 0.0), None);
        }
        // In the plane of a face: inside.
        let face = BoxRay { origin: DVec3::new(-1.0, 0.0, 1.0), direction: DVec3::X };
        assert_eq!(box_interval(face, 0.0), Some([1.0, 2.0]));
    }

    /// Four steps of √3/4 per diagonal; from t = 1 with jitter 1/2: 1.217, 1.650, and 2.083 is outside.
    #[test]
    fn one_cascade_by_hand() {
        let march = march(1, 2, 4);
        let samples = march.samples(along_x(-1.0), 0.5, &[0xff]);
        let dt = 3.0_f64.sqrt() / 4.0;
        assert_eq!(samples.len(), 2);
        for (sample, t) in samples.iter().zip([1.0 + 0.5 * dt, 1.0 + 1.5 * dt]) {
            assert!((sample.t - t).abs() < 1e-12 && (sample.delta - dt).abs() < 1e-12);
            assert!((sample.position - DVec3::new(t - 1.0, 0.5, 0.25)).length() < 1e-12);
        }
        // Cells: y = 0.5 is in the upper half, z = 0.25 in the lower: x + 2. Only x = 1 occupied:
        let upper = march.samples(along_x(-1.0), 0.5, &[1 << 3]);
        assert_eq!(upper, samples[1..]);
        let capped = March { max_steps: 1, ..march };
        assert_eq!(capped.samples(along_x(-1.0), 0.5, &[0xff]), samples[..1]);
        assert!(capped.samples(along_x(-1.0), 0.5, &[1 << 3]).is_empty());
    }

    /// Two cascades: dt_min = √3/2048, t1 = 256 dt_min = 0.2165; R = 512: dt_max = 1/512, t2 = 1/2.
    #[test]
    fn cone_by_hand() {
        let march = march(2, 512, 1024);
        let [dt, t1] = [3.0_f64.sqrt() / 2048.0, 3.0_f64.sqrt() / 8.0];
        let close = |a: f64, b: f64| (a - b).abs() < 1e-12;
        assert!(close(march.u_from_t(0.5 * t1), 128.0) && close(march.t_from_u(256.0), t1));
        assert!(close(march.t_from_u(257.0), t1 * (1.0 + CONE)));
        let u2 = 256.0 + (1024.0 / (512.0 * 3.0_f64.sqrt()) * 2.0).ln() / CONE.ln_1p();
        assert!(close(march.u_from_t(0.5), u2));
        assert!(close(march.t_from_u(u2 + 3.0), 0.5 + 3.0 / 512.0));
        for t in [0.0, 0.1, t1, 0.3, 0.4999, 0.5, 0.7, 1.5] {
            assert!(close(march.t_from_u(march.u_from_t(t)), t), "{t}");
        }
        let [t, step] = march.step(0.3, 0.25, 2);
        assert!(close(t, 0.3 * (1.0 + CONE).powf(2.25)) && close(step, t * CONE));
        let [t, step] = march.step(0.1, 0.0, 1);
        assert!(close(t, 0.1 + dt) && close(step, dt));

        let words = vec![u32::MAX; march.shape.cells() / 32];
        let samples = march.samples(along_x(-0.2), 0.0, &words);
        assert!(close(samples[0].t, 0.2) && close(samples[0].delta, 2.0 * dt));
        // A step spans the gap to the next sample.
        for pair in samples.windows(2) {
            assert!(close(pair[0].t + 0.5 * pair[0].delta, pair[1].t));
        }
    }
}
