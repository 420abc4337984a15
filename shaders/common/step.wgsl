// Provides: the numbers that change from step to step.

struct Step {
    // pcg(step + pcg(seed)): the start of this step's random numbers.
    stream: u32,
    // Occupancy update: first cell, distance between cells and number of cells of this chunk.
    first_cell: u32,
    cell_stride: u32,
    cell_count: u32,
    learning_rate: f32,
    // 1 / (1 - beta^t) of Adam's two moments.
    first_correction: f32,
    second_correction: f32,
}

var<uniform> step: Step;
