// Provides: photo_color for float photos (scene-linear, premultiplied).
// needs: photos

// Colour premultiplied by alpha, and alpha.
fn photo_color(first_row: u32, drawn: u32) -> vec4<f32> {
    let word = drawn * RECORD_WORDS;
    return bitcast<vec4<f32>>(vec4(
        photos_word(first_row, word),
        photos_word(first_row, word + 1u),
        photos_word(first_row, word + 2u),
        photos_word(first_row, word + 3u),
    ));
}
