// Provides: photo_position for photos of which masks leave pixels out.
// needs: photos

// Index of the drawn pixel in its photo, row by row.
fn photo_position(first_row: u32, drawn: u32) -> u32 {
    return photos_word(first_row, drawn * RECORD_WORDS + POSITION_WORD);
}
