//! Every check of `nerf check`: with the variants that the plan chooses, and with every other one that the adapter
//! can run.

use anyhow::Result;
use nerf::config::Accumulation;
use nerf::field::layer::Product;
use nerf::gpu::tensor::TensorMemory;
use nerf::verify::check::networks::{FieldShape, SHAPES, networks};
use nerf::verify::check::{
    Forced, activation, adam, exponential, fused, grid, harmonics, lens, loss, marching, occupancy, random,
    rays, rendered_view, selection, step, thinned,
};

use crate::bench::{adapter, adapter_with, modest_adapter, passes};

#[test]
fn exponentials() -> Result<()> {
    passes([exponential::exponentials(&adapter()?)?]);
    Ok(())
}

#[test]
fn random_numbers() -> Result<()> {
    passes([random::random_numbers(&adapter()?)?]);
    Ok(())
}

#[test]
fn lens_models() -> Result<()> {
    passes(lens::lens_models(&adapter()?)?);
    Ok(())
}

#[test]
fn view_rays() -> Result<()> {
    passes(rays::view_rays(&adapter()?)?);
    Ok(())
}

#[test]
fn sharp_rays() -> Result<()> {
    passes(rays::sharp_rays(&adapter()?)?);
    Ok(())
}

#[test]
fn training_rays() -> Result<()> {
    passes([rays::training_rays(&adapter()?)?]);
    Ok(())
}

#[test]
fn marched_samples() -> Result<()> {
    passes(marching::marched_samples(&adapter()?)?);
    Ok(())
}

#[test]
fn grid_features() -> Result<()> {
    passes([grid::features(&adapter()?)?]);
    Ok(())
}

#[test]
fn selected_samples() -> Result<()> {
    passes([selection::selected_samples(&adapter()?)?]);
    Ok(())
}

#[test]
fn harmonics_of_directions() -> Result<()> {
    passes([harmonics::harmonics(&adapter()?)?]);
    Ok(())
}

#[test]
fn activations() -> Result<()> {
    passes([activation::activations(&adapter()?)?]);
    Ok(())
}

#[test]
fn networks_and_scatter() -> Result<()> {
    passes(networks(&adapter()?, &SHAPES)?);
    Ok(())
}

#[test]
fn networks_of_further_shapes() -> Result<()> {
    let shape =
        |width, color_layers, hdr| FieldShape { levels: 8, width, color_layers, hdr, saturated: false };
    passes(networks(&adapter()?, &[shape(16, 3, true), shape(32, 3, false), shape(64, 1, true)])?);
    Ok(())
}

#[test]
fn render_loss_and_gradient() -> Result<()> {
    passes(fused::fused(&adapter()?)?);
    passes(vec![thinned::thinned_rays(&adapter()?)?]);
    Ok(())
}

#[test]
fn adam_on_table_and_networks() -> Result<()> {
    passes(adam::adam(&adapter()?)?);
    Ok(())
}

#[test]
fn further_terms_of_the_loss() -> Result<()> {
    passes(loss::further_terms(&adapter()?)?);
    Ok(())
}

#[test]
fn occupancy_update() -> Result<()> {
    passes([occupancy::occupancy_update(&adapter()?)?]);
    Ok(())
}

#[test]
fn one_step() -> Result<()> {
    passes([step::one_step(&adapter()?, &step::setups())?]);
    Ok(())
}

#[test]
fn rendered_views() -> Result<()> {
    passes(rendered_view::rendered_views(&adapter()?)?);
    Ok(())
}

/// A field that is quick to build, in every variant.
const SMALL: &[FieldShape] = SHAPES.split_at(1).0;

/// The checks whose kernels an accumulation changes.
#[test]
fn every_accumulation() -> Result<()> {
    for accumulation in [
        Accumulation::Ordered,
        Accumulation::Fixed,
        Accumulation::Long,
        Accumulation::Float,
        Accumulation::Exchange,
    ] {
        let forced = Forced { accumulation: Some(accumulation), ..Forced::default() };
        let adapter = match adapter_with(forced) {
            Ok(adapter) => adapter,
            Err(error) if matches!(accumulation, Accumulation::Float | Accumulation::Long) => {
                println!("left out: {error:#}");
                continue;
            }
            Err(error) => return Err(error),
        };
        println!("{}", adapter.describe()?);
        passes(networks(&adapter, SMALL)?);
        passes(adam::adam(&adapter)?);
    }
    Ok(())
}

/// The checks whose kernels a product changes.
#[test]
fn every_product() -> Result<()> {
    for product in
        [Product::Rows(1), Product::Rows(2), Product::Rows(4), Product::SharedWeights, Product::Tiled]
    {
        let forced = Forced { product: Some(product), ..Forced::default() };
        let adapter = match adapter_with(forced) {
            Ok(adapter) => adapter,
            Err(error) if product == Product::SharedWeights => {
                println!("left out: {error:#}");
                continue;
            }
            Err(error) => return Err(error),
        };
        println!("{}", adapter.describe()?);
        passes(networks(&adapter, SMALL)?);
    }
    Ok(())
}

/// Tiles whose sides are no powers of two, or that fill the memory of a workgroup, and whole steps and views.
#[test]
fn tiles_of_every_shape() -> Result<()> {
    let adapter = adapter_with(Forced { product: Some(Product::Tiled), ..Forced::default() })?;
    let shape = |levels, width, color_layers| FieldShape {
        levels,
        width,
        color_layers,
        hdr: false,
        saturated: false,
    };
    passes(networks(&adapter, &SHAPES)?);
    passes(networks(&adapter, &[shape(24, 48, 2), shape(8, 112, 1), shape(16, 128, 3)])?);
    let setups = step::setups();
    passes([step::one_step(&adapter, &[setups[0].clone(), setups[4].clone()])?]);
    passes(rendered_view::rendered_views(&adapter)?);
    Ok(())
}

/// Every check, with tensors in buffers whatever suits this adapter best.
#[test]
fn tensors_in_buffers() -> Result<()> {
    let adapter = adapter_with(Forced { memory: Some(TensorMemory::Buffers), ..Forced::default() })?;
    passes(marching::marched_samples(&adapter)?);
    passes([
        grid::features(&adapter)?,
        selection::selected_samples(&adapter)?,
        harmonics::harmonics(&adapter)?,
    ]);
    passes(networks(&adapter, SMALL)?);
    passes(fused::fused(&adapter)?);
    passes(vec![thinned::thinned_rays(&adapter)?]);
    passes(adam::adam(&adapter)?);
    passes([occupancy::occupancy_update(&adapter)?]);
    passes(rendered_view::rendered_views(&adapter)?);
    passes([rays::training_rays(&adapter)?]);
    passes(loss::further_terms(&adapter)?);
    let setups = step::setups();
    passes([step::one_step(&adapter, &[setups[0].clone(), setups[4].clone()])?]);
    Ok(())
}

/// Browsers and modest GPUs have eight storage buffers, 128 MiB of each, and none of the features that others have.
#[test]
fn what_webgpu_guarantees_is_enough() -> Result<()> {
    let adapter = modest_adapter()?;
    passes([rays::training_rays(&adapter)?, step::one_step(&adapter, &step::setups())?]);
    passes(loss::further_terms(&adapter)?);
    passes(rendered_view::rendered_views(&adapter)?);
    Ok(())
}
