// Provides: magnitude_bits, the bits of the largest of four magnitudes; see common/usable.wgsl.

fn magnitude_bits(value: vec4<f32>) -> u32 {
    let bits = bitcast<vec4<u32>>(value) & vec4(0x7fffffffu);
    return max(max(bits.x, bits.y), max(bits.z, bits.w));
}
