//! Speed of the whole training step: rays, marching, density, selection, colour, the fused kernel, backward,
//! Adam, and the updates of the occupancy grid in between.
//!
//! ```text
//! cargo bench --bench step -- --config full --seconds 30
//! ```
//!
//! Four measurements: the start, in a process of its own with the driver's cache off; the throughput, as
//! `nerf train` trains; views of the field that this trained; and the time of each stage, with a wait after each step, its arithmetic and traffic, and their
//! share of what the adapter can do (`cargo bench --bench ceilings`).

mod report;
mod stages;
mod views;
mod work;

use anyhow::{Context, Result, bail, ensure};
use clap::{Parser, ValueEnum};
use nerf::camera::Camera;
use nerf::capture::dataset::{Dataset, OpenOptions};
use nerf::config::Config;
use nerf::field::trainer::{StepStats, Trainer};
use nerf::field::{Field, Plan};
use nerf::gpu::timer::Timer;
use nerf::gpu::{Gpu, adapter};
use nerf::run::TrainingPhotos;
use nerf::verify::scene;
use report::{result, table};
use serde::Serialize;
use serde_json::{Value, json};
use stages::{StageTime, stage_times};
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::time::Instant;
use views::Views;

/// Steps between two looks at the counters, as in `nerf train`.
const BLOCK: u32 = 16;
/// Steps whose stages are timed.
const TIMED_STEPS: u32 = 64;
/// Two cores: what CPU time is divided by, so that figures from busy machines can be compared.
const CORES: f64 = 2.0;
/// Turn the shader caches on disk off, in Mesa and in NVIDIA's driver.
const NO_DRIVER_CACHE: [(&str, &str); 2] =
    [("MESA_SHADER_CACHE_DISABLE", "true"), ("__GL_SHADER_DISK_CACHE", "0")];

/// Measures the speed of a training step.
#[derive(Debug, Parser)]
struct Args {
    /// The network and batch
    #[arg(long, value_enum, default_value = "full")]
    config: Preset,
    /// Change one setting, for example grid.levels=8; may be repeated
    #[arg(long, value_name = "KEY.PATH=VALUE")]
    set: Vec<String>,
    /// The dataset to train on [default: the scene `toys`, 100 views of 100x100 pixels, generated]
    #[arg(long)]
    dataset: Option<PathBuf>,
    /// Seconds of measured training
    #[arg(long, default_value = "30")]
    seconds: f64,
    /// Seconds of training before, so that the occupancy grid has found the scene
    #[arg(long, default_value = "30")]
    warm: f64,
    /// Views to render after it, as the training cameras see
    #[arg(long, default_value = "8")]
    views: usize,
    /// How many times as much of a view is in work at once as the adapter gets; may be repeated
    #[arg(long, value_name = "FACTOR", default_value = "1")]
    rounds: Vec<usize>,
    /// The adapter: an index of `nerf adapters`, or parts of its name and backend [default: the first]
    #[arg(long)]
    adapter: Option<String>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
    /// What `cargo bench --bench ceilings` wrote, to compare the stages with
    #[arg(long, value_name = "FILE")]
    ceilings: Option<PathBuf>,
    /// Also write that object to a file
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Leave the cold start out
    #[arg(long)]
    no_start: bool,
    /// Only take the first step and tell how long its parts took
    #[arg(long, hide = true)]
    only_start: bool,
    /// What cargo adds
    #[arg(long, hide = true)]
    bench: bool,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Preset {
    /// 16 levels of 2^15 entries, networks 64 wide, two hidden layers of colour, 2^15 samples per step; every
    /// marched sample up to where its ray is opaque is trained on, as in instant-ngp
    Full,
    /// What `nerf train` takes on a CPU
    Cpu,
    /// What `nerf train` takes on a GPU
    Gpu,
}

impl Preset {
    fn config(self) -> Result<Config> {
        let mut config = Config::preset(!matches!(self, Self::Gpu), false)?;
        if matches!(self, Self::Full) {
            config.merge(&json!({
                "grid": { "levels": 16, "log2_table": 15 },
                "network": { "width": 64, "color_layers": 2 },
                "march": { "steps": 320 },
                "selection": { "weight_floor": 0 },
                "batch": { "kept": 1 << 15, "samples": 1 << 17, "rays": 1 << 15 },
            }))?;
        }
        Ok(config)
    }
}

/// Seconds from the start of a process to the end of its first step, and what they went to.
#[derive(Debug, Default, Serialize)]
struct Start {
    seconds: f64,
    dataset_seconds: f64,
    device_seconds: f64,
    kernels_seconds: f64,
    warm_up_seconds: f64,
    first_step_seconds: f64,
}

/// What was trained in some time.
#[derive(Debug, Default, Serialize)]
struct Throughput {
    seconds: f64,
    /// Of all threads; `None` where the system does not tell.
    cpu_seconds: Option<f64>,
    first_step: u32,
    steps: u32,
    rays: u64,
    marched: u64,
    /// Kept samples: those with colour and gradients.
    samples: u64,
    loss: f64,
    samples_per_second: f64,
    /// `samples / (cpu_seconds / 2)`
    samples_per_second_of_two_cores: Option<f64>,
}

/// All that is measured.
#[derive(Debug, Default, Serialize)]
struct Measured {
    #[serde(rename = "cold_start")]
    start: Option<Start>,
    throughput: Throughput,
    /// One for each room of a round.
    views: Vec<Views>,
    /// Empty where the adapter has no timestamps.
    stages: Vec<StageTime>,
}

/// A training run ready for its first step.
struct Run {
    gpu: Arc<Gpu>,
    trainer: Trainer,
    /// Those that it is trained on.
    cameras: Vec<Camera>,
    learning_rate: f64,
    start: Start,
}

fn main() -> Result<()> {
    let began = Instant::now();
    let args = Args::parse();
    let generated = tempfile::tempdir()?;
    let dataset = match &args.dataset {
        Some(path) => path.clone(),
        None => generate(&generated.path().join("toys"))?,
    };
    if args.only_start {
        return only_start(&args, &dataset, began);
    }
    let ceilings = args.ceilings.as_deref().map_or(Value::Null, ceilings);
    // What is measured behind it does not depend on it.
    let told = |error: anyhow::Error| say(&format!("warning: no cold start: {error:#}"));
    let start = if args.no_start { None } else { cold_start(&args, &dataset).map_err(told).ok() };
    let mut run = Run::new(&args, &dataset)?;
    say("warming up");
    run.train(args.warm)?;
    say("measuring");
    let throughput = run.train(args.seconds)?;
    ensure!(throughput.samples > 0, "the rays meet nothing: the field is empty");
    let mut measured = Measured { start, throughput, ..Measured::default() };
    // Should what follows hang, the throughput is known.
    save(&args, &result(&args, &run, &measured))?;
    say("rendering views");
    for &factor in &args.rounds {
        measured.views.push(Views::measure(run.trainer.field(), &run.cameras, factor, args.views)?);
    }
    say("timing the stages");
    measured.stages = run.stages(&ceilings)?;
    let result = result(&args, &run, &measured);
    save(&args, &result)?;
    let text = if args.json { result.to_string() } else { table(&result, &measured) };
    Ok(writeln!(std::io::stdout(), "{text}")?)
}

/// The ceilings of a file. Without them nothing is compared: that is no reason not to measure.
fn ceilings(file: &Path) -> Value {
    let read = std::fs::read(file).map_err(anyhow::Error::new);
    read.and_then(|text| Ok(serde_json::from_slice(&text)?)).unwrap_or_else(|error| {
        say(&format!("warning: no ceilings in {}: {error}", file.display()));
        Value::Null
    })
}

fn save(args: &Args, result: &Value) -> Result<()> {
    let Some(file) = &args.out else { return Ok(()) };
    std::fs::write(file, format!("{result}\n")).with_context(|| format!("writing {}", file.display()))
}

fn say(text: &str) {
    // A lost line of progress is no reason to fail.
    let _ = writeln!(std::io::stderr(), "{text}");
}

fn generate(folder: &Path) -> Result<PathBuf> {
    say("generating the scene toys");
    let options = scene::SceneOptions {
        views: scene::ViewCounts::of_total(100)?,
        size: (100, 100),
        ..scene::SceneOptions::new("toys")
    };
    scene::generate(&options, folder, &|_| {})?;
    Ok(folder.to_owned())
}

/// Starts this program again without the driver's cache, and waits for its first step.
fn cold_start(args: &Args, dataset: &Path) -> Result<Start> {
    say("starting from cold");
    let mut command = Command::new(std::env::current_exe()?);
    command.arg("--only-start").arg("--dataset").arg(dataset).envs(NO_DRIVER_CACHE);
    let preset = args.config.to_possible_value().context("a preset has a name")?;
    command.args(["--config", preset.get_name()]);
    command.args(args.set.iter().flat_map(|set| ["--set", set]));
    command.args(args.adapter.iter().flat_map(|name| ["--adapter", name]));
    let clock = Instant::now();
    let mut child = command.stdout(Stdio::piped()).spawn()?;
    let mut line = String::new();
    BufReader::new(child.stdout.take().context("a piped stdout")?).read_line(&mut line)?;
    let seconds = clock.elapsed().as_secs_f64();
    ensure!(child.wait()?.success(), "the cold start failed");
    let parts: Value = serde_json::from_str(&line).context("reading the cold start")?;
    let part = |key: &str| parts[key].as_f64().with_context(|| format!("the cold start lacks {key}"));
    Ok(Start {
        seconds,
        dataset_seconds: part("dataset_seconds")?,
        device_seconds: part("device_seconds")?,
        kernels_seconds: part("kernels_seconds")?,
        warm_up_seconds: part("warm_up_seconds")?,
        first_step_seconds: part("first_step_seconds")?,
    })
}

/// The child of [`cold_start`].
fn only_start(args: &Args, dataset: &Path, began: Instant) -> Result<()> {
    let mut run = Run::new(args, dataset)?;
    let clock = Instant::now();
    run.trainer.step(run.learning_rate, None)?;
    run.trainer.report()?;
    run.start.first_step_seconds = clock.elapsed().as_secs_f64();
    run.start.seconds = began.elapsed().as_secs_f64();
    Ok(writeln!(std::io::stdout(), "{}", serde_json::to_string(&run.start)?)?)
}

impl Run {
    fn new(args: &Args, dataset: &Path) -> Result<Self> {
        let mut start = Start::default();
        let mut clock = Instant::now();
        let mut lap = || std::mem::replace(&mut clock, Instant::now()).elapsed().as_secs_f64();
        let dataset = Dataset::open(dataset, &OpenOptions::default())?;
        start.dataset_seconds = lap();
        let gpu = Arc::new(Gpu::open(&adapter::choose(args.adapter.as_deref())?)?);
        start.device_seconds = lap();
        let mut config = args.config.config()?;
        for assignment in &args.set {
            config.set(assignment)?;
        }
        config.validate()?;
        let learning_rate = config.optimizer.learning_rate;
        let plan = Plan::for_dataset(&gpu, &dataset, config)?;
        let views = TrainingPhotos::of(&dataset).load(&gpu, &plan, &mut ())?;
        start.dataset_seconds += lap();
        let cameras = dataset.train.iter().map(|&index| dataset.frames[index].camera.clone()).collect();
        let mut trainer = Trainer::new(Field::new(&gpu, plan)?, views)?;
        start.kernels_seconds = lap();
        trainer.warm_up()?;
        start.warm_up_seconds = lap();
        Ok(Self { gpu, trainer, cameras, learning_rate, start })
    }

    /// Trains for some seconds, in blocks.
    fn train(&mut self, seconds: f64) -> Result<Throughput> {
        let (clock, cpu) = (Instant::now(), cpu_seconds());
        let mut sum = Throughput { first_step: self.trainer.steps(), ..Throughput::default() };
        while clock.elapsed().as_secs_f64() < seconds {
            for _ in 0..BLOCK {
                self.trainer.step(self.learning_rate, None)?;
            }
            sum.add(self.trainer.report()?);
        }
        sum.seconds = clock.elapsed().as_secs_f64();
        sum.cpu_seconds = cpu.zip(cpu_seconds()).map(|(before, after)| after - before);
        if !sum.loss.is_finite() {
            bail!("the loss is not finite any more: training diverged");
        }
        let samples = sum.samples as f64;
        sum.samples_per_second = samples / sum.seconds.max(1e-9);
        sum.samples_per_second_of_two_cores = sum.cpu_seconds.map(|cpu| samples / (cpu / CORES).max(1e-9));
        Ok(sum)
    }

    /// The time of each stage; empty where the adapter has no timestamps.
    fn stages(&mut self, ceilings: &Value) -> Result<Vec<StageTime>> {
        let Ok(mut timer) = Timer::new(&self.gpu) else { return Ok(Vec::new()) };
        let clock = Instant::now();
        for _ in 0..TIMED_STEPS {
            self.trainer.step(self.learning_rate, Some(&mut timer))?;
        }
        let stats = self.trainer.report()?;
        let seconds = clock.elapsed().as_secs_f64();
        stage_times(timer.totals(), seconds, stats, self.trainer.plan(), ceilings)
    }
}

impl Throughput {
    fn add(&mut self, block: StepStats) {
        self.steps += block.steps;
        self.rays += block.rays;
        self.marched += block.marched;
        self.samples += block.samples;
        self.loss = block.loss;
    }
}

/// User and system time of this process, all threads together. Linux counts it in hundredths of a second.
fn cpu_seconds() -> Option<f64> {
    let stat = std::fs::read_to_string("/proc/self/stat").ok()?;
    // The second field, the name in parentheses, may hold spaces; user and system time are the 14th and 15th.
    let (_, fields) = stat.rsplit_once(')')?;
    let ticks = fields.split_whitespace().skip(11).take(2).map(|field| field.parse::<f64>().ok());
    Some(ticks.sum::<Option<f64>>()? / 100.0)
}
