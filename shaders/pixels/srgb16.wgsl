// Provides: photo_color for 16-bit photos (straight alpha, kept in their display-referred values).
// needs: photos

// Colour premultiplied by alpha, and alpha.
fn photo_color(first_row: u32, drawn: u32) -> vec4<f32> {
    let word = drawn * RECORD_WORDS;
    let red_green = unpack2x16unorm(photos_word(first_row, word));
    let blue_alpha = unpack2x16unorm(photos_word(first_row, word + 1u));
    return vec4(vec3(red_green, blue_alpha.x) * blue_alpha.y, blue_alpha.y);
}
