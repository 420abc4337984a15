// Provides: lens_undistort for OpenCV's radial-tangential model, by Newton's method.

const NEWTON_STEPS = 16;

// The distorted point and the rows of its Jacobian.
struct Distortion {
    point: vec2<f32>,
    d_x: vec2<f32>,
    d_y: vec2<f32>,
}

fn lens_distort(p: vec2<f32>, radial: vec4<f32>, tangential: vec2<f32>) -> Distortion {
    let r2 = dot(p, p);
    let scale = 1.0 + r2 * (radial.x + r2 * (radial.y + r2 * (radial.z + r2 * radial.w)));
    let d_scale = radial.x + r2 * (2.0 * radial.y + r2 * (3.0 * radial.z + r2 * 4.0 * radial.w));
    let xy = p.x * p.y;
    let point = p * scale + vec2(
        2.0 * tangential.x * xy + tangential.y * (r2 + 2.0 * p.x * p.x),
        tangential.x * (r2 + 2.0 * p.y * p.y) + 2.0 * tangential.y * xy,
    );
    let cross = 2.0 * d_scale * xy + 2.0 * tangential.x * p.x + 2.0 * tangential.y * p.y;
    let d_x = vec2(scale + 2.0 * d_scale * p.x * p.x + 2.0 * tangential.x * p.y + 6.0 * tangential.y * p.x, cross);
    let d_y = vec2(cross, scale + 2.0 * d_scale * p.y * p.y + 6.0 * tangential.x * p.y + 2.0 * tangential.y * p.x);
    return Distortion(point, d_x, d_y);
}

// xy: the ideal image-plane point; z: 1 where there is one. Steps are bounded and a point is only accepted
// where the model still grows outwards: beyond its fold a distorted pixel has no ray.
fn lens_undistort(distorted: vec2<f32>, radial: vec4<f32>, tangential: vec2<f32>) -> vec3<f32> {
    var p = distorted;
    var error = 1e9;
    var determinant = 0.0;
    for (var i = 0; i < NEWTON_STEPS; i++) {
        let at = lens_distort(p, radial, tangential);
        let miss = distorted - at.point;
        error = dot(miss, miss);
        determinant = at.d_x.x * at.d_y.y - at.d_x.y * at.d_y.x;
        if error < 1e-14 || determinant <= 1e-6 {
            break;
        }
        let newton = vec2(at.d_y.y * miss.x - at.d_x.y * miss.y, at.d_x.x * miss.y - at.d_y.x * miss.x) / determinant;
        let longest = 0.5 * (1.0 + length(p));
        p += newton * min(1.0, longest / max(length(newton), 1e-12));
    }
    let found = error < 1e-8 * (1.0 + dot(distorted, distorted)) && determinant > 1e-6;
    return vec3(p, select(0.0, 1.0, found));
}
