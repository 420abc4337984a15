//! Every kernel on whatever adapter there is: the comparisons of `nerf check`, and what is no comparison.
//!
//! A machine without an adapter fails these tests; a software driver (lavapipe) is enough.
//! `NERF_ADAPTER` chooses one, as `--adapter` does. Run with `--nocapture` to see the worst errors.

mod adam;
mod bench;
mod checks;
mod close;
mod composite;
mod device;
mod grid;
mod marching;
mod occupancy;
mod rays;
mod selection;
mod step;
