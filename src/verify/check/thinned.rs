//! The fused kernel on rays of which samples were left out.

use super::CheckResult;
use super::checked_adapter::CheckedAdapter;
use super::fused::{BOUND, Fused, SAMPLES};
use super::inputs::Random;
use super::stress_rays::StressRay;
use super::workbench::KeptStep;
use crate::config::Transmittance;
use crate::verify::reference::composite::{
    CompositeInput, CompositeOutput, opacity, optical_depths, transmittances,
};
use crate::verify::reference::loss::{Loss, Places, composite_with};
use crate::verify::reference::selection::thin;
use anyhow::Result;

/// Samples of the rays: a selection with a floor of 1 % of the ray's weight keeps hardly more.
const LENGTHS: [usize; 8] = [0, 1, 2, 3, 7, 20, 60, 130];

/// Smaller colours and gradients may vanish in single precision.
const LEAST: f64 = 1e-30;

/// A stress ray whose samples were kept.
struct ThinnedRay {
    ray: StressRay,
    /// Optical depth of what was left out in front of each sample, and behind the last.
    gaps: Vec<f64>,
    tail: f64,
    gains: Vec<[f64; 2]>,
}

/// Rays of all kinds with gaps and gains at random, against rays on which samples without a gain fill the gaps.
///
/// # Errors
/// When the device was lost or refuses the kernel.
pub fn thinned_rays(adapter: &CheckedAdapter) -> Result<CheckResult> {
    let source = "as above; what a gap hides rounds as if it were seen";
    let mut result = CheckResult::new("render, loss, gradient: thinned", BOUND, source);
    let mut random = Random::new(2);
    let fused = Fused::new(adapter, Transmittance::Exclusive, SAMPLES)?;
    for length in LENGTHS {
        let rays: Vec<_> =
            (0..4 * StressRay::KINDS).map(|number| ThinnedRay::new(&mut random, number, length)).collect();
        let inputs: Vec<_> = rays.iter().map(|ray| ray.ray.input(rays.len() as u32)).collect();
        let spans = fused.upload(&inputs);
        fused.bench.write("kept_steps", &rays.iter().flat_map(ThinnedRay::steps).collect::<Vec<_>>());
        fused.bench.write("ray_tails", &rays.iter().map(|ray| ray.tail as f32).collect::<Vec<_>>());
        for (ray, got) in rays.iter().zip(fused.outputs(&inputs, &spans)?) {
            ray.compare(&mut result, &got, rays.len() as u32);
        }
    }
    Ok(result)
}

impl ThinnedRay {
    /// Gaps share a depth of up to 3, but for one in ten rays with a gap that nothing passes; each is a share of the rest
    /// of the ray's brightness at most, and so is the weight of a sample that stands for others.
    fn new(random: &mut Random, number: usize, samples: usize) -> Self {
        let ray = StressRay::new(random, number, samples);
        let depths = optical_depths(&ray.input(1));
        let single = |x: f64| f64::from(x as f32);
        let gap = |random: &mut Random| match random.number(0.0, 1.0) {
            chance if chance < 0.3 => 0.0,
            chance if chance < 0.3 + 0.1 / samples as f64 => random.number(10.0, 90.0),
            _ => single(random.number(-12.0, 1.0).exp() / samples as f64),
        };
        let gain = |random: &mut Random, depth: f64| {
            // So that its weight is at most that of an opaque sample.
            let most = (1.0 / depth.clamp(1e-4, 1.0)).ln();
            single(random.number(-0.7, most.max(0.7)).exp())
        };
        let gains = |random: &mut Random, depth: f64| match random.number(0.0, 4.0) as u32 {
            0 => [1.0; 2],
            1 => [gain(random, depth), 0.0],
            2 => [0.0, gain(random, depth)],
            _ => [gain(random, depth), gain(random, depth)],
        };
        Self {
            gaps: (0..samples).map(|_| gap(random)).collect(),
            tail: if samples > 0 { gap(random) } else { 0.0 },
            gains: depths.iter().map(|&depth| gains(random, depth)).collect(),
            ray,
        }
    }

    /// As the kernel takes them.
    fn steps(&self) -> Vec<KeptStep> {
        let step = |k: usize| {
            let [first, second] = self.gains[k].map(|gain| gain as f32);
            let [s, delta, gap] = [self.ray.s[k], self.ray.delta[k], self.gaps[k]].map(|x| x as f32);
            [[s, delta, gap, 0.0], [first, second, 0.0, 0.0]]
        };
        (0..self.gaps.len()).map(step).collect()
    }

    /// The ray with a sample in each gap, and one behind the last of its own: sample `k` is the `2k + 1`st.
    fn filled(&self) -> (StressRay, Vec<[f64; 2]>) {
        let mut filled =
            StressRay { target: self.ray.target, background: self.ray.background, ..StressRay::default() };
        let mut gains = Vec::new();
        let mut push = |s: f64, delta: f64, color: [f64; 3], gain: [f64; 2]| {
            filled.s.push(s);
            filled.delta.push(delta);
            filled.color.push(color);
            gains.push(gain);
        };
        for k in 0..self.gaps.len() {
            push(self.gaps[k].ln(), 1.0, [0.5; 3], [0.0; 2]);
            push(self.ray.s[k], self.ray.delta[k], self.ray.color[k], self.gains[k]);
        }
        push(self.tail.ln(), 1.0, [0.5; 3], [0.0; 2]);
        (filled, gains)
    }

    fn compare(&self, result: &mut CheckResult, got: &CompositeOutput, rays: u32) {
        let (filled, gains) = self.filled();
        let input = filled.input(rays);
        let want =
            composite_with(Loss::default(), Transmittance::Exclusive, &input, Places::default(), &gains);
        let sizes = Sizes::new(&input, &gains);
        let case = |what: &str| format!("{what} of thinned '{}'", self.ray.name);
        let rendered = |x: usize| sizes.rendered[0][x].max(sizes.rendered[1][x]).max(LEAST);
        result.each(&case("R"), &got.rendered, &want.rendered, rendered);
        result.value(got.loss, want.loss, sizes.loss.max(LEAST), || case("loss"));
        for k in 0..self.gaps.len() {
            let own = 2 * k + 1;
            let by_color = |x: usize| sizes.d_color[own][x].max(LEAST);
            result.each(&case("by colour"), &got.d_color[k], &want.d_color[own], by_color);
            result.value(got.d_s[k], want.d_s[own], sizes.d_s[own].max(LEAST), || case("by log-density"));
        }
    }
}

/// Sizes of the terms that values are summed from.
struct Sizes {
    /// `Σ ω |c_x| + T_e |b_x| + |g_x|` of both estimates.
    rendered: [[f64; 4]; 2],
    loss: f64,
    d_color: Vec<[f64; 3]>,
    d_s: Vec<f64>,
}

impl Sizes {
    fn new(ray: &CompositeInput<'_>, gains: &[[f64; 2]]) -> Self {
        let m = f64::from(ray.rays_in_batch);
        let of = [0, 1]
            .map(|e| thin(Transmittance::Exclusive, ray, &gains.iter().map(|g| g[e]).collect::<Vec<_>>()));
        let depths = optical_depths(ray);
        let through = transmittances(Transmittance::Inclusive, &depths);
        let end = through.last().copied().unwrap_or(1.0);
        let color = |i: usize| [ray.color[i][0], ray.color[i][1], ray.color[i][2], 1.0];
        let behind = [ray.background[0], ray.background[1], ray.background[2], 0.0];
        let error = |e: usize, x: usize| (of[e].rendered[x] - ray.target[x]).abs();
        let mut sizes = Self {
            rendered: [std::array::from_fn(|x| end * behind[x] + ray.target[x]); 2],
            loss: 0.0,
            d_color: vec![[0.0; 3]; depths.len()],
            d_s: vec![0.0; depths.len()],
        };
        for (e, estimate) in of.iter().enumerate() {
            for (i, weight) in estimate.weights.iter().enumerate() {
                (0..4).for_each(|x| sizes.rendered[e][x] += weight * color(i)[x]);
            }
        }
        sizes.loss = (0..4).map(|x| sizes.rendered[0][x] * sizes.rendered[1][x]).sum::<f64>() / (4.0 * m);
        for (e, estimate) in of.iter().enumerate() {
            let other = sizes.rendered[1 - e];
            // What is seen from just behind, and the weights there. A gap takes its share from what is seen.
            let (mut seen, mut weight) = (behind, end);
            for i in (0..depths.len()).rev() {
                let (own, gain) = (color(i), gains[i][e]);
                (0..3).for_each(|x| sizes.d_color[i][x] += other[x] * estimate.weights[i] / (4.0 * m));
                let terms =
                    |x: usize| gain * depths[i] * (own[x] * (through[i] + weight) + through[i] * seen[x]);
                let of_channel = |x: usize| error(1 - e, x) * terms(x) + other[x] * estimate.by_s[i][x].abs();
                sizes.d_s[i] += (0..4).map(of_channel).sum::<f64>() / (4.0 * m);
                weight += estimate.weights[i];
                if gains[i] != [0.0; 2] {
                    let alpha = opacity(depths[i]);
                    (0..4).for_each(|x| seen[x] = gain.max(1.0) * alpha * own[x] + (1.0 - alpha) * seen[x]);
                }
            }
        }
        sizes
    }
}
