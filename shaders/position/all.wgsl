// Provides: photo_position for photos whose every pixel counts.

// Index of the drawn pixel in its photo, row by row.
fn photo_position(first_row: u32, drawn: u32) -> u32 {
    return drawn;
}
