//! Every check of `nerf check`: with the variants that the plan chooses, and with every other one that the adapter
//! can run.

use anyhow::Result;
use nerf::config::Accumulation;
use nerf::field::layer::Product;
use nerf::gpu::tensor::TensorMemory;
use nerf::verify::check::networks::{SHAPES, Shape, networks};
use nerf::verify::check::{
    Forced, activation, adam, exponential, fused, grid, harmonics, lens, loss, marching, occupancy, random,
    rays, selection, step, thinned, view,
};

use crate::bench::{modest_subject, passes, subject, subject_with};

#[test]
fn exponentials() -> Result<()> {
    passes([exponential::exponentials(&subject()?)?]);
    Ok(())
}

#[test]
fn random_numbers() -> Result<()> {
    passes([random::random_numbers(&subject()?)?]);
    Ok(())
}

#[test]
fn lens_models() -> Result<()> {
    passes(lens::lens_models(&subject()?)?);
    Ok(())
}

#[test]
fn view_rays() -> Result<()> {
    passes(rays::view_rays(&subject()?)?);
    Ok(())
}

#[test]
fn sharp_rays() -> Result<()> {
    passes(rays::sharp_rays(&subject()?)?);
    Ok(())
}

#[test]
fn training_rays() -> Result<()> {
    passes([rays::training_rays(&subject()?)?]);
    Ok(())
}

#[test]
fn marched_samples() -> Result<()> {
    passes(marching::marched_samples(&subject()?)?);
    Ok(())
}

#[test]
fn grid_features() -> Result<()> {
    passes([grid::features(&subject()?)?]);
    Ok(())
}

#[test]
fn selected_samples() -> Result<()> {
    passes([selection::selected_samples(&subject()?)?]);
    Ok(())
}

#[test]
fn harmonics_of_directions() -> Result<()> {
    passes([harmonics::harmonics(&subject()?)?]);
    Ok(())
}

#[test]
fn activations() -> Result<()> {
    passes([activation::activations(&subject()?)?]);
    Ok(())
}

#[test]
fn networks_and_scatter() -> Result<()> {
    passes(networks(&subject()?, &SHAPES)?);
    Ok(())
}

#[test]
fn networks_of_further_shapes() -> Result<()> {
    let shape = |width, color_layers, hdr| Shape { levels: 8, width, color_layers, hdr, saturated: false };
    passes(networks(&subject()?, &[shape(16, 3, true), shape(32, 3, false), shape(64, 1, true)])?);
    Ok(())
}

#[test]
fn render_loss_and_gradient() -> Result<()> {
    passes(fused::fused(&subject()?)?);
    passes(vec![thinned::thinned_rays(&subject()?)?]);
    Ok(())
}

#[test]
fn adam_on_table_and_networks() -> Result<()> {
    passes(adam::adam(&subject()?)?);
    Ok(())
}

#[test]
fn further_terms_of_the_loss() -> Result<()> {
    passes(loss::further_terms(&subject()?)?);
    Ok(())
}

#[test]
fn occupancy_update() -> Result<()> {
    passes([occupancy::occupancy_update(&subject()?)?]);
    Ok(())
}

#[test]
fn one_step() -> Result<()> {
    passes([step::one_step(&subject()?, &step::setups())?]);
    Ok(())
}

#[test]
fn rendered_views() -> Result<()> {
    passes(view::rendered_views(&subject()?)?);
    Ok(())
}

/// A field that is quick to build, in every variant.
const SMALL: &[Shape] = SHAPES.split_at(1).0;

/// The checks whose kernels an accumulation changes.
#[test]
fn every_accumulation() -> Result<()> {
    for accumulation in
        [Accumulation::Ordered, Accumulation::Fixed, Accumulation::Float, Accumulation::Exchange]
    {
        let forced = Forced { accumulation: Some(accumulation), ..Forced::default() };
        let subject = match subject_with(forced) {
            Ok(subject) => subject,
            Err(error) if accumulation == Accumulation::Float => {
                println!("left out: {error:#}");
                continue;
            }
            Err(error) => return Err(error),
        };
        println!("{}", subject.describe()?);
        passes(networks(&subject, SMALL)?);
        passes(adam::adam(&subject)?);
    }
    Ok(())
}

/// The checks whose kernels a product changes.
#[test]
fn every_product() -> Result<()> {
    for (rows, shared_weights) in [(1, false), (2, false), (4, false), (4, true)] {
        let forced = Forced { product: Some(Product { rows, shared_weights }), ..Forced::default() };
        let subject = match subject_with(forced) {
            Ok(subject) => subject,
            Err(error) if shared_weights => {
                println!("left out: {error:#}");
                continue;
            }
            Err(error) => return Err(error),
        };
        println!("{}", subject.describe()?);
        passes(networks(&subject, SMALL)?);
    }
    Ok(())
}

/// Every check, with tensors in buffers whatever suits this adapter best.
#[test]
fn tensors_in_buffers() -> Result<()> {
    let subject = subject_with(Forced { memory: Some(TensorMemory::Buffers), ..Forced::default() })?;
    passes(marching::marched_samples(&subject)?);
    passes([
        grid::features(&subject)?,
        selection::selected_samples(&subject)?,
        harmonics::harmonics(&subject)?,
    ]);
    passes(networks(&subject, SMALL)?);
    passes(fused::fused(&subject)?);
    passes(vec![thinned::thinned_rays(&subject)?]);
    passes(adam::adam(&subject)?);
    passes([occupancy::occupancy_update(&subject)?]);
    passes(view::rendered_views(&subject)?);
    passes([rays::training_rays(&subject)?]);
    passes(loss::further_terms(&subject)?);
    let setups = step::setups();
    passes([step::one_step(&subject, &[setups[0].clone(), setups[4].clone()])?]);
    Ok(())
}

/// Browsers and modest GPUs have eight storage buffers, 128 MiB of each, and none of the features that others have.
#[test]
fn what_webgpu_guarantees_is_enough() -> Result<()> {
    let subject = modest_subject()?;
    passes([rays::training_rays(&subject)?, step::one_step(&subject, &step::setups())?]);
    passes(loss::further_terms(&subject)?);
    passes(view::rendered_views(&subject)?);
    Ok(())
}
