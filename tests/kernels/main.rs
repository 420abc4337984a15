//! Every kernel against the f64 reference, on whatever adapter there is: values and gradients, at odd sizes.
//!
//! A machine without an adapter fails these tests; a software driver (lavapipe) is enough.
//! `NERF_ADAPTER` chooses one, as `--adapter` does. Run with `--nocapture` to see the worst errors.

mod adam;
mod bench;
mod close;
mod composite;
mod encode;
mod exponential;
mod layers;
mod marching;
mod occupancy;
mod random;
mod rays;
mod selection;
mod step;
mod view;
