//! What was measured, as JSON and as text.

use super::{Args, Measured, Run, Throughput, Views, stages};
use clap::ValueEnum;
use serde_json::{Value, json};

/// One JSON object.
pub(crate) fn result(args: &Args, run: &Run, measured: &Measured) -> Value {
    let (info, config) = (&run.gpu.info, &run.trainer.plan().config);
    let dataset = args.dataset.as_ref().and_then(|path| path.file_name()).map(|name| name.to_string_lossy());
    let mut result = json!({
        "preset": args.config.to_possible_value().map(|value| value.get_name().to_owned()),
        "config": config,
        "dataset": dataset.unwrap_or_else(|| "toys, 100x100, generated".into()),
        "adapter": info.name,
        "driver": format!("{} {}", info.driver, info.driver_info).trim(),
        "device_bytes": run.trainer.workspace().bytes(),
    });
    if let (Some(result), Value::Object(measured)) = (result.as_object_mut(), json!(measured)) {
        result.extend(measured);
    }
    result
}

/// Lines for readers.
pub(crate) fn table(result: &Value, measured: &Measured) -> String {
    let Measured { start, throughput, views, stages } = measured;
    let word = |key: &str| result[key].as_str().unwrap_or_default().to_owned();
    let mut lines = vec![
        format!("config     {}", word("preset")),
        format!("dataset    {}", word("dataset")),
        format!("adapter    {} ({})", word("adapter"), word("driver")),
        format!("memory     {} MiB on the device", result["device_bytes"].as_u64().unwrap_or(0) >> 20),
    ];
    lines.extend(start.as_ref().map(|s| {
        format!(
            "cold start {:.2} s to the end of the first step: dataset {:.2}, device {:.2}, kernels {:.2}, \
             warm-up {:.2}, step {:.3}",
            s.seconds,
            s.dataset_seconds,
            s.device_seconds,
            s.kernels_seconds,
            s.warm_up_seconds,
            s.first_step_seconds
        )
    }));
    let Throughput { first_step, steps, seconds, samples, marched, rays, .. } = throughput;
    let per_step = |count: &u64| count / u64::from((*steps).max(1));
    lines.push(format!(
        "steps      {first_step} to {} in {seconds:.1} s: {:.1} ms each with {} rays, {} marched and {} kept \
         samples",
        first_step + steps,
        1e3 * seconds / f64::from((*steps).max(1)),
        per_step(rays),
        per_step(marched),
        per_step(samples),
    ));
    lines.push(format!("samples/s  {:.0} kept, by the clock", throughput.samples_per_second));
    lines.extend(
        throughput
            .samples_per_second_of_two_cores
            .map(|rate| format!("samples/s  {rate:.0} kept, by CPU time on two cores")),
    );
    lines.extend(views.iter().map(Views::line));
    if !stages.is_empty() {
        lines.extend(stages::table(stages));
    }
    lines.join("\n")
}
