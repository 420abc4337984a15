// Provides: the ray of OpenCV's fisheye, by Newton's method between the axis and the rim, where bisection takes over
// when a step would leave what is left between them.
// needs: camera, sine

const FISHEYE_STEPS = 40;

// theta_d - theta of an angle theta, and the derivative of theta_d.
fn fisheye_bend(theta: f32, k: vec4<f32>) -> vec2<f32> {
    let t2 = theta * theta;
    let shift = theta * t2 * (k.x + t2 * (k.y + t2 * (k.z + t2 * k.w)));
    return vec2(shift, 1.0 + t2 * (3.0 * k.x + t2 * (5.0 * k.y + t2 * (7.0 * k.z + t2 * 9.0 * k.w))));
}

fn fisheye_ray(camera: Camera, plane: vec2<f32>) -> LensRay {
    let radius = length(plane);
    var low = 0.0;
    var high = camera.rim;
    var theta = min(radius, high);
    for (var i = 0; i < FISHEYE_STEPS; i++) {
        let at = fisheye_bend(theta, camera.radial);
        // The difference that does not round comes first.
        let miss = (radius - theta) - at.x;
        if miss > 0.0 {
            low = theta;
        } else {
            high = theta;
        }
        let newton = theta + miss / at.y;
        let next = select(0.5 * (low + high), newton, newton >= low && newton <= high);
        let moved = abs(next - theta);
        theta = next;
        if moved <= 1e-7 * theta {
            break;
        }
    }
    let angle = sine_cosine(theta);
    let across = plane * (angle.x / max(radius, 1e-20));
    let exists = radius - camera.rim <= fisheye_bend(camera.rim, camera.radial).x;
    return LensRay(vec2(0.0), vec3(across.x, -across.y, -angle.y), exists);
}
