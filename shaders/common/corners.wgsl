// Provides: gradient_scatter, which adds a sample's gradient of a level to the eight corners of its cell.
// needs: gradient_add, grid

fn gradient_scatter(position: vec3<f32>, level: Level, gradient: vec2<f32>) {
    let cell = grid_cell(position, level);
    gradient_add(cell.entries[0], cell.weights[0] * gradient);
    gradient_add(cell.entries[1], cell.weights[1] * gradient);
    gradient_add(cell.entries[2], cell.weights[2] * gradient);
    gradient_add(cell.entries[3], cell.weights[3] * gradient);
    gradient_add(cell.entries[4], cell.weights[4] * gradient);
    gradient_add(cell.entries[5], cell.weights[5] * gradient);
    gradient_add(cell.entries[6], cell.weights[6] * gradient);
    gradient_add(cell.entries[7], cell.weights[7] * gradient);
}
