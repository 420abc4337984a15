//! The bench all kernels are tested on: a small plan, all its buffers, and the only places that know what
//! the buffers look like. The tests run whole stages, and take gradients from Adam's first moments.

use std::sync::Arc;

use bytemuck::Pod;
use nerf::config::{
    self, Accumulation, Batch, Config, Grid, March, Network, Occupancy, Optimizer, Selection,
};
use nerf::gpu::pass::Stage;
use nerf::gpu::tensor::Memory;
use nerf::gpu::{Gpu, adapter};
use nerf::kernels::layer::Product;
use nerf::kernels::{
    Counters, Needs, Plan, Step, Workspace, color, density, dispatch, marching, occupancy, training,
};
use nerf::model::{COLOR_INPUTS, DENSITY_OUTPUTS, FEATURES, Layer, Layout};
use nerf::reference::grid::GridLevel;
use nerf::reference::mlp::{self, Mlp};
use nerf::reference::model::{Model, Objective, TrainingRay};
use nerf::reference::{ColorRange, Transmittance};

pub(crate) use crate::draw::{Random, SEED, STEP, dimension, quiet_step, random_batch, uniform};

/// What a bench is built from.
#[derive(Clone)]
pub(crate) struct Setup {
    pub(crate) config: Config,
    pub(crate) needs: Needs,
    pub(crate) finest: u32,
    /// How matrix products are written; `None` as the plan chooses.
    pub(crate) product: Option<Product>,
    /// Where tensors live; `None` as the plan chooses.
    pub(crate) memory: Option<Memory>,
}

impl Setup {
    /// A tiny field: 8 levels, dense and hashed, networks of width 16, 16³ cells, everything kept, and
    /// gradients left as Adam's first moments.
    pub(crate) fn tiny() -> Self {
        let config = Config {
            grid: Grid { levels: 8, base: 4, finest: 40, log2_table: 9 },
            network: Network { width: 16, color_layers: 1 },
            march: March { steps: 64, cone: 1.0 / 32.0, most_steps: 96, near: 0.05 },
            occupancy: Occupancy { cells: 16, ..Occupancy::default() },
            batch: Batch { kept: 256, samples: 512, rays: 256, first_rays: 64 },
            selection: Selection { weight_floor: 1e-12, keep_probability: 1.0, stop_transmittance: 0.0 },
            optimizer: Optimizer { beta_1: 0.0, l2: 0.0, ..Optimizer::default() },
            seed: SEED,
            ..Config::default()
        };
        let needs = Needs { lens: false, alpha: true, hdr: false, cascades: 1, cameras: 1 };
        Self { config, needs, finest: 40, product: None, memory: None }
    }

    pub(crate) fn network(mut self, width: usize, color_layers: usize) -> Self {
        self.config.network = Network { width, color_layers };
        self
    }

    pub(crate) fn hdr(mut self, hdr: bool) -> Self {
        self.needs.hdr = hdr;
        self
    }

    pub(crate) fn accumulation(mut self, accumulation: Accumulation) -> Self {
        self.config.accumulation = accumulation;
        self
    }

    pub(crate) fn transmittance(mut self, transmittance: Transmittance) -> Self {
        self.config.transmittance = match transmittance {
            Transmittance::Exclusive => config::Transmittance::Exclusive,
            Transmittance::Inclusive => config::Transmittance::Inclusive,
        };
        self
    }

    pub(crate) fn plan(&self, gpu: &Gpu) -> Plan {
        self.config.validate().expect("a valid configuration");
        let layout = Layout::new(&self.config, self.finest);
        let mut plan = Plan::new(gpu, self.config.clone(), layout, self.needs.clone());
        plan.product = self.product.unwrap_or(plan.product);
        plan.memory = self.memory.unwrap_or(plan.memory);
        plan
    }

    pub(crate) fn bench(&self) -> Bench {
        Bench::new(self)
    }
}

/// Opens the adapter under test.
pub(crate) fn open() -> Gpu {
    let choice = std::env::var("NERF_ADAPTER").ok();
    let adapter = adapter::choose(choice.as_deref())
        .expect("these tests need a Vulkan, Metal or DX12 adapter; a software driver will do");
    Gpu::open(&adapter).expect("the adapter opens")
}

/// A device with a plan and all its buffers.
pub(crate) struct Bench {
    pub(crate) gpu: Arc<Gpu>,
    pub(crate) plan: Plan,
    pub(crate) workspace: Workspace,
}

/// A kept sample.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Kept {
    /// Which of the marched samples.
    pub(crate) sample: u32,
    /// Its ray.
    pub(crate) ray: u32,
    /// Log-density.
    pub(crate) s: f32,
    /// Step, as long as that of all the samples it stands for.
    pub(crate) delta: f32,
}

/// What one pass over a batch left on the device.
pub(crate) struct Outcome {
    /// Raw outputs of the density network, `[samples, 16]`.
    pub(crate) density: Vec<f32>,
    /// Activated colours, `[kept, 3]`.
    pub(crate) color: Vec<f32>,
    /// Colour and opacity of the rays.
    pub(crate) rendered: Vec<[f32; 4]>,
    /// Loss of the batch.
    pub(crate) loss: f64,
    /// By the table, `[entries, 2]`.
    pub(crate) d_table: Vec<f32>,
    /// By each layer's weights, `[outputs, inputs]`, first the density network's layers.
    pub(crate) d_weights: Vec<Vec<f32>>,
}

impl Bench {
    fn new(setup: &Setup) -> Self {
        let gpu = Arc::new(open());
        let plan = setup.plan(&gpu);
        let workspace = allocate(&gpu, &plan).expect("buffers");
        let bench = Self { gpu, plan, workspace };
        bench.set_step(quiet_step());
        bench
    }

    pub(crate) fn write<T: Pod>(&self, name: &str, data: &[T]) {
        self.workspace.write(&self.gpu, name, data);
    }

    pub(crate) fn read<T: Pod>(&self, name: &str, count: usize) -> Vec<T> {
        self.workspace.read(&self.gpu, name, count).expect("a device that answers")
    }

    pub(crate) fn set_step(&self, step: Step) {
        self.write("step", &[step]);
    }

    pub(crate) fn counters(&self) -> Counters {
        self.read("counters", 1)[0]
    }

    /// Sets what is counted on the device, and the size of the dispatches over rays.
    pub(crate) fn set_counters(&self, counters: Counters) {
        self.write("counters", &[counters]);
        let groups = [[counters.rays.div_ceil(64).max(1), 1, 1, 0]];
        self.gpu.write(self.workspace.get("dispatch"), dispatch::RAYS, &groups);
    }

    /// Rays to draw or march.
    pub(crate) fn set_rays(&self, rays: usize) {
        self.set_counters(Counters { rays: rays as u32, ..Counters::default() });
    }

    pub(crate) fn run<'a>(&self, stages: impl IntoIterator<Item = &'a Stage>) {
        self.gpu.run("test", stages, None);
        self.gpu.wait().expect("stages that run");
    }

    /// Runs the one stage of `stages` that is called `label`.
    pub(crate) fn run_only(&self, stages: &[Stage], label: &str) {
        let labels: Vec<_> = stages.iter().map(|stage| stage.bound.label.as_str()).collect();
        let position = labels.iter().position(|&found| found == label);
        let position = position.unwrap_or_else(|| panic!("no stage '{label}' among {labels:?}"));
        self.run([&stages[position]]);
    }

    /// The layers of both networks, the density network first.
    pub(crate) fn layers(&self) -> Vec<Layer> {
        self.plan.layout.density.iter().chain(&self.plan.layout.color).copied().collect()
    }

    /// `[entries, 2]`.
    pub(crate) fn table(&self) -> Vec<f32> {
        self.read("table", self.plan.layout.entries * FEATURES)
    }

    pub(crate) fn set_table(&self, values: &[f32]) {
        self.write("table", values);
    }

    /// Adam's first and second moments of the table, `[entries, 2]` each.
    pub(crate) fn table_moments(&self) -> [Vec<f32>; 2] {
        let moments: Vec<[f32; 4]> = self.read("table_moments", self.plan.layout.entries);
        [0, 2].map(|at| moments.iter().flat_map(|entry| [entry[at], entry[at + 1]]).collect())
    }

    fn clear_table_moments(&self) {
        self.write("table_moments", &vec![[0.0_f32; 4]; self.plan.layout.entries]);
    }

    /// Origin and `t_near`, direction and `t_far` of the rays.
    pub(crate) fn rays(&self, count: usize) -> Vec<[[f32; 4]; 2]> {
        let origins: Vec<[f32; 4]> = self.read("ray_origins", count);
        let directions: Vec<[f32; 4]> = self.read("ray_directions", count);
        origins.into_iter().zip(directions).map(|(origin, direction)| [origin, direction]).collect()
    }

    /// The kept samples.
    pub(crate) fn kept(&self, count: usize) -> Vec<Kept> {
        let rows: Vec<[u32; 2]> = self.read("kept_rows", count);
        let steps: Vec<[f32; 4]> = self.read("kept_steps", count);
        (rows.into_iter().zip(steps))
            .map(|([sample, ray], [s, delta, ..])| Kept { sample, ray, s, delta })
            .collect()
    }

    /// Log-densities and steps of the kept samples, as if they had been chosen.
    pub(crate) fn set_kept_steps(&self, steps: &[[f32; 2]]) {
        self.write("kept_steps", &steps.iter().map(|&[s, delta]| [s, delta, 0.0, 0.0]).collect::<Vec<_>>());
    }

    /// The weights, or moments in their layout, layer by layer, `[outputs, inputs]`.
    pub(crate) fn weights(&self, name: &str) -> Vec<Vec<f32>> {
        let all: Vec<f32> = self.read(name, self.plan.layout.quads * 4);
        self.layers().iter().map(|layer| unpack(layer, &all)).collect()
    }

    pub(crate) fn set_weights(&self, name: &str, weights: &[Vec<f32>]) {
        self.write(name, &self.pack(weights));
    }

    /// The weight buffer's layout.
    pub(crate) fn pack(&self, weights: &[Vec<f32>]) -> Vec<f32> {
        let mut all = vec![0.0; self.plan.layout.quads * 4];
        for (layer, weights) in self.layers().iter().zip(weights) {
            assert_eq!(weights.len(), layer.inputs * layer.outputs);
            for (i, &weight) in weights.iter().enumerate() {
                all[layer.index(i / layer.inputs, i % layer.inputs)] = weight;
            }
        }
        all
    }

    /// The table's gradient, ready for Adam.
    pub(crate) fn set_table_gradient(&self, gradient: &[f32], rays: usize) {
        if self.plan.accumulation == Accumulation::Fixed {
            let scale = 2.0 * rays as f64 * 4_194_304.0;
            let fixed = |value: f32| (f64::from(value) * scale).round() as i64;
            let packed: Vec<i64> = (gradient.as_chunks::<2>().0.iter())
                .map(|[low, high]| fixed(*low) + (fixed(*high) << 32))
                .collect();
            self.write("d_table", &packed);
        } else {
            self.write("d_table", gradient);
        }
    }

    /// Random parameters: the table within ±`table`, weights within ±`gain` times Glorot's bound.
    pub(crate) fn randomise(&self, random: &mut Random, table: f64, gain: f64) {
        self.set_table(&random.numbers(self.plan.layout.entries * FEATURES, -table, table));
        let last = self.layers().len() - 1;
        let weights: Vec<Vec<f32>> = (self.layers().iter().enumerate())
            .map(|(number, layer)| {
                let most = gain * (6.0 / (layer.inputs + layer.outputs) as f64).sqrt();
                let mut weights = random.numbers(layer.inputs * layer.outputs, -most, most);
                if number == last {
                    weights[3 * layer.inputs..].fill(0.0);
                }
                weights
            })
            .collect();
        self.set_weights("mlp", &weights);
    }

    /// The parameters on the device, as the reference takes them.
    pub(crate) fn model(&self) -> Model {
        self.model_of(&self.table(), &self.weights("mlp"))
    }

    pub(crate) fn model_of(&self, table: &[f32], weights: &[Vec<f32>]) -> Model {
        let layers: Vec<mlp::Layer> = (self.layers().iter().zip(weights))
            .map(|(layer, weights)| {
                let outputs = if layer.outputs == 4 { 3 } else { layer.outputs };
                let weights = weights[..outputs * layer.inputs].iter().map(|&w| f64::from(w)).collect();
                mlp::Layer { inputs: layer.inputs, outputs, weights }
            })
            .collect();
        let (density, color) = layers.split_at(self.plan.layout.density.len());
        assert_eq!(color[0].inputs, COLOR_INPUTS);
        Model {
            levels: self.levels(),
            table: table.iter().map(|&x| f64::from(x)).collect(),
            density: Mlp { layers: density.to_vec() },
            color: Mlp { layers: color.to_vec() },
        }
    }

    pub(crate) fn levels(&self) -> Vec<GridLevel> {
        (self.plan.layout.levels.iter())
            .map(|level| GridLevel {
                resolution: level.resolution,
                offset: level.first as usize,
                entries: level.entries as usize,
                dense: level.dense == 1,
            })
            .collect()
    }

    pub(crate) fn objective(&self) -> Objective {
        let transmittance = match self.plan.config.transmittance {
            config::Transmittance::Exclusive => Transmittance::Exclusive,
            config::Transmittance::Inclusive => Transmittance::Inclusive,
        };
        let color_range = if self.plan.needs.hdr { ColorRange::Hdr } else { ColorRange::Ldr };
        Objective { transmittance, color_range }
    }

    /// Puts a batch on the device as if it had been drawn and marched.
    pub(crate) fn upload(&self, rays: &[TrainingRay]) {
        let (mut spans, mut samples) = (Vec::new(), Vec::new());
        for ray in rays {
            spans.push([0, ray.samples.len() as u32]);
            samples.extend(ray.samples.iter().map(|sample| {
                let [x, y, z] = sample.position.as_vec3().to_array();
                [x, y, z, sample.delta as f32]
            }));
        }
        let directions: Vec<[f32; 4]> =
            rays.iter().map(|ray| ray.direction.as_vec3().extend(1.0).to_array()).collect();
        let targets: Vec<_> = rays.iter().map(|ray| ray.target.map(|x| x as f32)).collect();
        let backgrounds: Vec<_> =
            rays.iter().map(|ray| ray.background.map(|x| x as f32)).map(|[r, g, b]| [r, g, b, 0.0]).collect();
        self.write("ray_directions", &directions);
        self.write("ray_spans", &spans);
        self.write("samples", &samples);
        self.write("targets", &targets);
        self.write("backgrounds", &backgrounds);
        // The scan turns counts into spans and sets all dispatch sizes.
        self.set_rays(rays.len());
        let scan = marching::scan(&self.gpu, &self.plan, &self.workspace, marching::Scanned::Samples);
        self.run([&scan.expect("scan")]);
        assert_eq!(self.counters().samples as usize, samples.len());
    }

    /// Raw log-densities of the samples, as if the network had run.
    pub(crate) fn set_raw_density(&self, raw: &[f32]) {
        let mut outputs = vec![0.0; raw.len() * DENSITY_OUTPUTS];
        outputs.iter_mut().step_by(DENSITY_OUTPUTS).zip(raw).for_each(|(output, &raw)| *output = raw);
        self.write("density_out", &outputs);
    }

    /// Raw outputs of the density network, `[samples, 16]`.
    pub(crate) fn density(&self, samples: usize) -> Vec<f32> {
        self.read("density_out", samples * DENSITY_OUTPUTS)
    }

    pub(crate) fn color(&self, kept: usize) -> Vec<f32> {
        let color: Vec<[f32; 4]> = self.read("color", kept);
        color.iter().flat_map(|color| [color[0], color[1], color[2]]).collect()
    }

    /// Everything behind marching, from encoding to Adam.
    pub(crate) fn stages(&self) -> Vec<Stage> {
        let (gpu, plan, workspace) = (&self.gpu, &self.plan, &self.workspace);
        let mut stages = density::stages(gpu, plan, workspace).expect("density");
        stages.extend(color::stages(gpu, plan, workspace, color::Selection::Training).expect("color"));
        stages.push(training::composite(gpu, plan, workspace, true).expect("composite"));
        stages.extend(training::backward(gpu, plan, workspace).expect("backward"));
        stages.extend(training::weight_gradients(gpu, plan, workspace).expect("weight gradients"));
        stages.extend(training::update(gpu, plan, workspace).expect("update"));
        stages
    }

    /// Runs a batch from samples to gradients.
    pub(crate) fn train(&self, stages: &[Stage], rays: &[TrainingRay]) -> Outcome {
        self.clear_table_moments();
        self.upload(rays);
        self.run(stages);
        let counters = self.counters();
        let kept = counters.kept as usize;
        let loss = f64::from(counters.sum_loss);
        let [d_table, _] = self.table_moments();
        Outcome {
            density: self.density(counters.samples as usize),
            color: self.color(kept),
            rendered: self.read("rendered", counters.rays_used as usize),
            loss,
            d_table,
            d_weights: self.weights("mlp_first"),
        }
    }
}

/// The cells that can hold something: all but every fifth.
pub(crate) fn visible_cells(plan: &Plan) -> Vec<u32> {
    (0..plan.cell_count() as u32).filter(|cell| cell % 5 != 0).collect()
}

fn allocate(gpu: &Gpu, plan: &Plan) -> anyhow::Result<Workspace> {
    let mut workspace = Workspace::default();
    marching::allocate(gpu, plan, &mut workspace)?;
    density::allocate_parameters(gpu, plan, &mut workspace)?;
    density::allocate(gpu, plan, &mut workspace)?;
    color::allocate(gpu, plan, &mut workspace)?;
    training::allocate(gpu, plan, &mut workspace)?;
    occupancy::allocate(gpu, &mut workspace, &visible_cells(plan))?;
    workspace.add(gpu.storage::<f32>("weights", plan.config.batch.samples)?);
    Ok(workspace)
}

fn unpack(layer: &Layer, all: &[f32]) -> Vec<f32> {
    (0..layer.outputs * layer.inputs).map(|i| all[layer.index(i / layer.inputs, i % layer.inputs)]).collect()
}
