// Provides: photo_color for 8-bit photos (straight alpha, kept in their display-referred values).
// needs: photos

// Colour premultiplied by alpha, and alpha.
fn photo_color(first_row: u32, drawn: u32) -> vec4<f32> {
    let color = unpack4x8unorm(photos_word(first_row, drawn * RECORD_WORDS));
    return vec4(color.rgb * color.a, color.a);
}
