// Provides: sine and cosine whose error does not depend on the driver; WGSL allows 2^-11, a third of a pixel of a
// fisheye.

// Sine and cosine of an angle within [-4, 4]; errors about 6e-8.
fn sine_cosine(angle: f32) -> vec2<f32> {
    let n = i32(round(angle * 0.636619772));
    // Half of pi in two parts, the first 201/128, so that the difference does not round; a product of integers, as
    // in `exponential`.
    let x = (angle - f32(n * 201) / 128.0) - f32(n) * 4.83826795e-4;
    let x2 = x * x;
    let sine = x + x * x2 * (-0.166666667 + x2 * (8.33333333e-3 + x2 * (-1.98412698e-4 + x2 * 2.75573192e-6)));
    let cosine = 1.0 + x2 * (-0.5 + x2 * (0.0416666667 + x2 * (-1.38888889e-3 + x2 * (2.48015873e-5
        - x2 * 2.75573192e-7))));
    let turned = select(vec2(sine, cosine), vec2(cosine, -sine), (n & 1) != 0);
    return select(turned, -turned, (n & 2) != 0);
}
