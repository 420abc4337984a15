//! What an adapter can do at most: arithmetic, memory, gathers, atomics, and the time that dispatches and submissions
//! take by themselves. The step benchmark compares its stages with this.
//!
//! ```text
//! cargo bench --bench ceilings -- --out ceilings.json
//! cargo bench --bench step -- --ceilings ceilings.json
//! ```

use anyhow::{Context, Result};
use clap::Parser;
use nerf::gpu::buffer::Buffer;
use nerf::gpu::kernel::Kernel;
use nerf::gpu::pass::{GROUP_COLUMNS, Stage};
use nerf::gpu::source::Source;
use nerf::gpu::{Gpu, WANTED_FEATURES, adapter};
use nerf::support::file::write_atomically;
use serde_json::{Value, json};
use std::io::Write;
use std::iter::repeat_n;
use std::path::PathBuf;
use std::time::Instant;

const MIB: usize = 1 << 20;
/// Sizes of the tables that are gathered from.
const TABLES: [(&str, usize); 3] = [("4 MiB", 4 * MIB), ("16 MiB", 16 * MIB), ("64 MiB", 64 * MIB)];
/// Of the table that is added to: 2^19 entries of 16 levels have 64 MiB, but most levels fewer.
const SUMS: usize = 16 * MIB;
/// Of each of the two buffers of a copy; less where the adapter binds less.
const COPY: usize = 256 * MIB;
/// Threads, and rounds of each.
const THREADS: usize = 1 << 18;
const ROUNDS: usize = 64;
/// Elements that results are thrown into.
const SINK: usize = 1 << 12;
/// Multiply-adds of a round, two operations each.
const FLOPS_OF_ROUND: usize = 8 * 4 * 2;
/// Dispatches of one submission, and submissions, whose times are averaged.
const DISPATCHES: usize = 512;
const SUBMISSIONS: usize = 64;

/// What atomics of 64 bits need.
const LONG_INTEGERS: wgpu::Features =
    wgpu::Features::SHADER_INT64.union(wgpu::Features::SHADER_INT64_ATOMIC_ALL_OPS);

/// Measures what an adapter can do at most.
#[derive(Debug, Parser)]
struct Args {
    /// Seconds of each measurement
    #[arg(long, default_value = "0.3")]
    seconds: f64,
    /// The adapter: an index of `nerf adapters`, or parts of its name and backend [default: the first]
    #[arg(long)]
    adapter: Option<String>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
    /// Also write that object to a file
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// What cargo adds
    #[arg(long, hide = true)]
    bench: bool,
}

macro_rules! part {
    ($name:literal) => {
        ($name, include_str!(concat!($name, ".wgsl")))
    };
}

type Part = (&'static str, &'static str);

/// An open adapter, and how long to measure on it.
struct Bench {
    gpu: Gpu,
    seconds: f64,
    sink: Buffer,
}

fn main() -> Result<()> {
    let args = Args::parse();
    let adapter = adapter::choose(args.adapter.as_deref())?;
    let gpu = Gpu::open_with(&adapter, WANTED_FEATURES | LONG_INTEGERS, adapter.limits())?;
    let sink = gpu.storage::<[f32; 4]>("sink", SINK)?;
    let save = |result: &Value| match &args.out {
        // A call that is killed leaves a whole file.
        Some(file) => write_atomically(file, |to| Ok(writeln!(to, "{result}")?)),
        None => Ok(()),
    };
    let result = Bench { gpu, seconds: args.seconds, sink }.run(&save)?;
    let text = if args.json { result.to_string() } else { table(&result) };
    Ok(writeln!(std::io::stdout(), "{text}")?)
}

impl Bench {
    /// Measures everything; `save` is given what is known each time that there is more.
    fn run(&self, save: &dyn Fn(&Value) -> Result<()>) -> Result<Value> {
        let info = &self.gpu.info;
        let mut result = json!({
            "adapter": info.name,
            "driver": format!("{} {}", info.driver, info.driver_info).trim(),
        });
        let mut add = |kind: &str, name: Option<&str>, value: Option<f64>| {
            match name {
                Some(name) => result[kind][name] = json!(value),
                None => result[kind] = json!(value),
            }
            save(&result)
        };
        add("flops_per_second", None, Some(self.multiply_adds()?))?;
        add("copied_bytes_per_second", None, Some(self.copies()?))?;
        for (name, bytes) in TABLES {
            add("gathers_per_second", Some(name), Some(self.gathers(bytes)?))?;
        }
        for (name, part, bytes, needed) in [
            ("float", part!("add_float"), 4, wgpu::Features::SHADER_FLOAT32_ATOMIC),
            ("exchange", part!("add_exchange"), 4, wgpu::Features::empty()),
            ("integer", part!("add_integer"), 4, wgpu::Features::empty()),
            ("long integer", part!("add_long"), 8, LONG_INTEGERS),
        ] {
            let rate = self.gpu.has(needed).then(|| self.adds(part, bytes)).transpose()?;
            add("atomics_per_second", Some(name), rate)?;
        }
        add("dispatch_seconds", None, Some(self.dispatch()?))?;
        add("submission_seconds", None, Some(self.submission()?))?;
        add("read_back_seconds", None, Some(self.read_back()?))?;
        Ok(result)
    }

    /// A stage of `threads` threads of these parts.
    fn stage(&self, label: &str, source: Source, buffers: &[&Buffer], threads: usize) -> Result<Stage> {
        let source = source.count("SINK_MASK", SINK - 1);
        let kernel = Kernel::new(&self.gpu, &source, &[]).with_context(|| label.to_owned())?;
        let resources: Vec<_> = buffers.iter().map(|buffer| buffer.resource()).collect();
        Ok(Stage::wide(kernel.bind(&self.gpu, &resources)?, threads))
    }

    /// Seconds of one run of `stage`: as many as fit into the time are submitted, at least three; the fastest third's
    /// mean.
    fn time(&self, stage: &Stage) -> Result<f64> {
        let run = |times: usize| -> Result<f64> {
            let clock = Instant::now();
            self.gpu.run("ceiling", repeat_n(stage, times), None)?;
            self.gpu.wait()?;
            Ok(clock.elapsed().as_secs_f64() / times as f64)
        };
        // The first run loads the code and touches the memory.
        run(1)?;
        let once = run(1)?.max(1e-7);
        let times = ((self.seconds / 9.0 / once) as usize).clamp(1, 1000);
        let mut seconds = Vec::new();
        let clock = Instant::now();
        while seconds.len() < 3 || clock.elapsed().as_secs_f64() < self.seconds {
            seconds.push(run(times)?);
        }
        seconds.sort_by(f64::total_cmp);
        let fastest = &seconds[..seconds.len().div_ceil(3)];
        Ok(fastest.iter().sum::<f64>() / fastest.len() as f64)
    }

    fn multiply_adds(&self) -> Result<f64> {
        let rounds = 16 * ROUNDS;
        let (name, text) = part!("multiply_add");
        let source = Source::new(name).count("ROUNDS", rounds).part(name, text);
        let stage = self.stage(name, source, &[&self.sink], THREADS)?;
        Ok((THREADS * rounds * FLOPS_OF_ROUND) as f64 / self.time(&stage)?)
    }

    /// Bytes read and bytes written, both counted.
    fn copies(&self) -> Result<f64> {
        let limits = self.gpu.device.limits();
        let most = limits.max_buffer_size.min(limits.max_storage_buffer_binding_size) as usize;
        let count = COPY.min(most) / 16;
        let buffers =
            [self.gpu.storage::<[f32; 4]>("source", count)?, self.gpu.storage::<[f32; 4]>("copied", count)?];
        let (name, text) = part!("copy");
        let source = Source::new(name).count("COUNT", count).count("GROUP_COLUMNS", GROUP_COLUMNS as usize);
        let stage = self.stage(name, source.part(name, text), &buffers.each_ref(), count)?;
        Ok((2 * 16 * count) as f64 / self.time(&stage)?)
    }

    /// Reads of 8 bytes from a table of so many.
    fn gathers(&self, bytes: usize) -> Result<f64> {
        let table = self.gpu.storage::<u8>("table", bytes)?;
        let stage = self.random_stage("gathers", &[part!("gather")], bytes / 8, &[&table, &self.sink])?;
        Ok((THREADS * ROUNDS) as f64 / self.time(&stage)?)
    }

    /// Additions to sums of so many bytes.
    fn adds(&self, add_one: Part, bytes: usize) -> Result<f64> {
        let sums = self.gpu.storage::<u8>("sums", SUMS)?;
        let stage = self.random_stage(add_one.0, &[add_one, part!("add")], SUMS / bytes, &[&sums])?;
        Ok((THREADS * ROUNDS) as f64 / self.time(&stage)?)
    }

    fn random_stage(
        &self,
        label: &str,
        parts: &[Part],
        entries: usize,
        buffers: &[&Buffer],
    ) -> Result<Stage> {
        let source = Source::new(label).count("ROUNDS", ROUNDS).count("INDEX_MASK", entries - 1);
        let parts = [&[part!("random")], parts].concat();
        let source = parts.iter().fold(source, |source, (name, text)| source.part(name, *text));
        self.stage(label, source, buffers, THREADS)
    }

    /// Seconds from the end of one dispatch to the end of the next, which waits for it and does nothing.
    fn dispatch(&self) -> Result<f64> {
        let (name, text) = part!("empty");
        let stage = self.stage(name, Source::new(name).part(name, text), &[&self.sink], 1)?;
        let run = |times: usize| -> Result<f64> {
            let clock = Instant::now();
            self.gpu.run("empty", repeat_n(&stage, times), None)?;
            self.gpu.wait()?;
            Ok(clock.elapsed().as_secs_f64())
        };
        run(DISPATCHES)?;
        median(
            (0..SUBMISSIONS / 4).map(|_| Ok((run(2 * DISPATCHES)? - run(DISPATCHES)?) / DISPATCHES as f64)),
        )
    }

    /// Seconds of a submission of nothing, waited for.
    fn submission(&self) -> Result<f64> {
        median((0..SUBMISSIONS).map(|_| {
            let clock = Instant::now();
            self.gpu.submit(self.gpu.encoder("nothing"));
            self.gpu.wait()?;
            Ok(clock.elapsed().as_secs_f64())
        }))
    }

    /// Seconds until a few bytes are read back.
    fn read_back(&self) -> Result<f64> {
        median((0..SUBMISSIONS).map(|_| {
            let clock = Instant::now();
            self.gpu.read::<[f32; 4]>(&self.sink, 0, 1)?;
            Ok(clock.elapsed().as_secs_f64())
        }))
    }
}

fn median(values: impl Iterator<Item = Result<f64>>) -> Result<f64> {
    let mut values = values.collect::<Result<Vec<_>>>()?;
    values.sort_by(f64::total_cmp);
    Ok(values[values.len() / 2])
}

/// Lines for readers.
fn table(result: &Value) -> String {
    let giga = |value: &Value| value.as_f64().map_or("-".into(), |value| format!("{:.2}", value / 1e9));
    let micro =
        |key: &str| result[key].as_f64().map_or("-".into(), |seconds| format!("{:.1}", seconds * 1e6));
    let word = |key: &str| result[key].as_str().unwrap_or_default();
    let mut lines = vec![
        format!("adapter             {} ({})", word("adapter"), word("driver")),
        format!("multiply-adds       {} GFLOP/s", giga(&result["flops_per_second"])),
        format!("copy                {} GB/s, read and written", giga(&result["copied_bytes_per_second"])),
    ];
    for (kind, what) in [("gathers", "G/s of 8 bytes from"), ("atomics", "G/s of")] {
        let entries = result[format!("{kind}_per_second")].as_object();
        lines.extend(
            entries
                .into_iter()
                .flatten()
                .map(|(name, value)| format!("{kind:18}  {} {what} {name}", giga(value))),
        );
    }
    lines.extend([
        format!("dispatch            {} µs, behind another", micro("dispatch_seconds")),
        format!("submission          {} µs, waited for", micro("submission_seconds")),
        format!("read-back           {} µs", micro("read_back_seconds")),
    ]);
    lines.join("\n")
}
