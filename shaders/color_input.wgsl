// The colour network's input: the density network's outputs and the harmonics of the ray's direction.
// Needs: counters, ray, harmonics.

var<storage, read> counters: Counters;
var<storage, read> rays: array<Ray>;
var<storage, read> density_out: array<vec4<f32>>;
var<storage, read> kept_sample: array<u32>;
var<storage, read> kept_ray: array<u32>;
// `[kept, 8]`: 16 features, 16 harmonics.
var<storage, read_write> color_input: array<vec4<f32>>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let index = id.x;
    if index >= counters.kept {
        return;
    }
    let sample = kept_sample[index] * 4u;
    let terms = harmonics(rays[kept_ray[index]].direction);
    for (var i = 0u; i < 4u; i++) {
        color_input[index * 8u + i] = density_out[sample + i];
    }
    color_input[index * 8u + 4u] = terms[0];
    color_input[index * 8u + 5u] = terms[1];
    color_input[index * 8u + 6u] = terms[2];
    color_input[index * 8u + 7u] = terms[3];
}
