// Provides: real spherical harmonics up to degree 3 (16 terms) of a unit direction; see
// `reference::harmonics`.

fn harmonics(d: vec3<f32>) -> array<vec4<f32>, 4> {
    let x = d.x;
    let y = d.y;
    let z = d.z;
    let xx = x * x;
    let yy = y * y;
    let zz = z * z;
    return array<vec4<f32>, 4>(
        vec4(0.28209479177387814, -0.48860251190291987 * y, 0.48860251190291987 * z, -0.48860251190291987 * x),
        vec4(
            1.0925484305920792 * x * y,
            -1.0925484305920792 * y * z,
            0.94617469575756001 * zz - 0.31539156525252005,
            -1.0925484305920792 * x * z,
        ),
        vec4(
            0.54627421529603959 * (xx - yy),
            0.59004358992664352 * y * (yy - 3.0 * xx),
            2.8906114426405538 * x * y * z,
            0.45704579946446572 * y * (1.0 - 5.0 * zz),
        ),
        vec4(
            0.3731763325901154 * z * (5.0 * zz - 3.0),
            0.45704579946446572 * x * (1.0 - 5.0 * zz),
            1.4453057213202769 * z * (xx - yy),
            0.59004358992664352 * x * (3.0 * yy - xx),
        ),
    );
}
