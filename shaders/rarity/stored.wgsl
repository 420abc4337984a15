// Needs: occupancy. Provides: the rarity of a place in box space: how many times as many cameras see the best seen place.

// `[CASCADES, RARITY_CELLS, RARITY_CELLS, RARITY_CELLS]`, x fastest.
var<storage, read> rarities: array<f32>;

fn rarity(position: vec3<f32>) -> f32 {
    let cascade = cascade_at(position);
    let at = cascade_position(position, cascade) * (f32(RARITY_CELLS) / f32(CELLS));
    return rarities[cell_at(at, cascade, RARITY_CELLS)];
}
