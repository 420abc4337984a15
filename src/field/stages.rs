//! The stages of a step and of a round of a view, one file each: rays → march → density → color → composite → backward →
//! optimize, the update of the occupancy grid, and what only views have.

pub mod backward;
pub mod color;
pub mod composite;
pub mod density;
pub mod march;
pub mod occupancy;
pub mod optimize;
pub mod rays;
pub mod viewing;
