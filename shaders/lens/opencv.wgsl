// Provides: the ray of OpenCV's radial-tangential model. The undistorted point is followed from the axis outwards, in
// one stride for ordinary lenses and in shorter ones near a fold: Newton's method from the far end alone may land
// on a branch beyond the fold.
// needs: camera

const OPENCV_STRIDES = 40;
const OPENCV_STEPS = 10;

// Distorted minus undistorted point, and the rows of the Jacobian of the distorted one.
struct Bend {
    shift: vec2<f32>,
    d_x: vec2<f32>,
    d_y: vec2<f32>,
}

fn opencv_bend(p: vec2<f32>, radial: vec4<f32>, tangential: vec2<f32>) -> Bend {
    let r2 = dot(p, p);
    let scale = r2 * (radial.x + r2 * (radial.y + r2 * (radial.z + r2 * radial.w)));
    let d_scale = radial.x + r2 * (2.0 * radial.y + r2 * (3.0 * radial.z + r2 * 4.0 * radial.w));
    let xy = p.x * p.y;
    let shift = p * scale + vec2(
        2.0 * tangential.x * xy + tangential.y * (r2 + 2.0 * p.x * p.x),
        tangential.x * (r2 + 2.0 * p.y * p.y) + 2.0 * tangential.y * xy,
    );
    let cross = 2.0 * d_scale * xy + 2.0 * tangential.x * p.x + 2.0 * tangential.y * p.y;
    let d_x = vec2(
        1.0 + scale + 2.0 * d_scale * p.x * p.x + 2.0 * tangential.x * p.y + 6.0 * tangential.y * p.x,
        cross,
    );
    let d_y = vec2(
        cross,
        1.0 + scale + 2.0 * d_scale * p.y * p.y + 6.0 * tangential.x * p.y + 2.0 * tangential.y * p.x,
    );
    return Bend(shift, d_x, d_y);
}

fn bend_determinant(bend: Bend) -> f32 {
    return bend.d_x.x * bend.d_y.y - bend.d_x.y * bend.d_y.x;
}

// The change of the undistorted point that changes the distorted one by `change`.
fn bend_solve(bend: Bend, change: vec2<f32>) -> vec2<f32> {
    let step = vec2(bend.d_y.y * change.x - bend.d_x.y * change.y, bend.d_x.x * change.y - bend.d_y.x * change.x);
    return step / bend_determinant(bend);
}

// From the undistorted point `start`, imaged at `origin`, to the one imaged at `target_point`: xy, and z 1 where it
// is safely on the same branch.
fn opencv_stride(start: vec2<f32>, origin: vec2<f32>, target_point: vec2<f32>, camera: Camera) -> vec3<f32> {
    let at_start = opencv_bend(start, camera.radial, camera.tangential);
    let predicted = bend_solve(at_start, target_point - origin);
    let reach = 0.5 * length(predicted) + 1e-6;
    var p = start + predicted;
    for (var i = 0; i < OPENCV_STEPS; i++) {
        let at = opencv_bend(p, camera.radial, camera.tangential);
        if !(bend_determinant(at) > 0.05 * bend_determinant(at_start)) {
            break;
        }
        // The difference that does not round comes first.
        let step = bend_solve(at, (target_point - p) - at.shift);
        p += step;
        if !(distance(p, start + predicted) <= reach) {
            break;
        }
        if length(step) <= 2e-7 * (1.0 + length(p)) {
            // Beyond the rim there may be a branch on which the Jacobian is positive again.
            return vec3(p, select(0.0, 1.0, length(p) <= camera.rim));
        }
    }
    return vec3(p, 0.0);
}

fn opencv_ray(camera: Camera, plane: vec2<f32>) -> LensRay {
    var p = vec2(0.0);
    var reached = 0.0;
    var stride = 1.0;
    for (var i = 0; i < OPENCV_STRIDES && reached < 1.0; i++) {
        let next = min(reached + stride, 1.0);
        let found = opencv_stride(p, plane * reached, plane * next, camera);
        if found.z > 0.0 {
            p = found.xy;
            reached = next;
            stride *= 2.0;
        } else {
            stride *= 0.5;
        }
    }
    return LensRay(vec2(0.0), vec3(p.x, -p.y, -1.0), reached >= 1.0);
}
