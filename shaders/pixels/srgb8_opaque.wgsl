// Provides: photo_color for 8-bit photos without alpha (kept in their display-referred values).
// needs: photos

// Colour, and alpha 1.
fn photo_color(first_row: u32, drawn: u32) -> vec4<f32> {
    return vec4(unpack4x8unorm(photos_word(first_row, drawn * RECORD_WORDS)).rgb, 1.0);
}
