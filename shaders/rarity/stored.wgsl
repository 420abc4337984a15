// Needs: occupancy. Provides: the rarity of a place in box space: how many times as many cameras see the best seen place.

// `[CASCADES, RARITY_CELLS, RARITY_CELLS, RARITY_CELLS]`, x fastest.
var<storage, read> rarities: array<f32>;

fn rarity(position: vec3<f32>) -> f32 {
    let cascade = cascade_at(position);
    let at = cascade_position(position, cascade) * (f32(RARITY_CELLS) / f32(CELLS));
    let cell = vec3<u32>(clamp(at, vec3(0.0), vec3(f32(RARITY_CELLS) - 1.0)));
    return rarities[cell.x + RARITY_CELLS * (cell.y + RARITY_CELLS * (cell.z + RARITY_CELLS * cascade))];
}
