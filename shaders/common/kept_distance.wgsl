// Provides: kept_distance, how far along its ray a kept sample lies, in sides of the inner cube.

tensor<read> samples: vec4<f32>;
tensor<read> kept_rows: vec2<u32>;

fn kept_distance(origin: vec3<f32>, direction: vec3<f32>, i: u32) -> f32 {
    let position = samples_load(kept_rows_load(i).x).xyz;
    return dot(position - origin, direction) * DENSITY_SCALE;
}
