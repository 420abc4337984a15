// Provides: row_spread, the order in which rows of workgroups take what becomes more and more work from one to the next, such
// as levels of the grid. A software driver gives each of its threads a run of rows: with the even ones first, all runs have
// the same work.

fn row_spread(row: u32, rows: u32) -> u32 {
    let even = (rows + 1u) / 2u;
    return select(2u * (row - even) + 1u, 2u * row, row < even);
}
