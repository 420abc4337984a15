//! Times of single stages, from the device's own timestamps.

use super::Gpu;
use anyhow::{Result, bail};
use std::collections::BTreeMap;

const MOST_STAGES: u32 = 256;

/// Collects start and end of each stage of one submission, and their sums over many.
#[derive(Debug)]
pub struct Timer {
    queries: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    staging: wgpu::Buffer,
    period_ns: f64,
    labels: Vec<String>,
    totals: BTreeMap<String, f64>,
}

impl Timer {
    /// A timer on `gpu`.
    ///
    /// # Errors
    /// When the adapter has no timestamps.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        if !gpu.has(wgpu::Features::TIMESTAMP_QUERY) {
            bail!("the adapter '{}' has no timestamps: stages cannot be timed on it", gpu.info.name);
        }
        let bytes = u64::from(MOST_STAGES) * 2 * 8;
        let buffer = |label, usage| {
            gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size: bytes,
                usage,
                mapped_at_creation: false,
            })
        };
        use wgpu::BufferUsages as Usage;
        Ok(Self {
            queries: gpu.device.create_query_set(&wgpu::QuerySetDescriptor {
                label: Some("timer"),
                ty: wgpu::QueryType::Timestamp,
                count: MOST_STAGES * 2,
            }),
            resolved: buffer("timer", Usage::QUERY_RESOLVE | Usage::COPY_SRC),
            staging: buffer("timer read back", Usage::MAP_READ | Usage::COPY_DST),
            period_ns: f64::from(gpu.queue.get_timestamp_period()),
            labels: Vec::new(),
            totals: BTreeMap::new(),
        })
    }

    /// The timestamps around the next stage; `None` once all are used.
    pub(super) fn writes(&mut self, label: &str) -> Option<wgpu::ComputePassTimestampWrites<'_>> {
        let index = self.labels.len() as u32;
        if index >= MOST_STAGES {
            return None;
        }
        self.labels.push(label.to_owned());
        Some(wgpu::ComputePassTimestampWrites {
            query_set: &self.queries,
            beginning_of_pass_write_index: Some(index * 2),
            end_of_pass_write_index: Some(index * 2 + 1),
        })
    }

    pub(super) fn resolve(&self, encoder: &mut wgpu::CommandEncoder) {
        let count = self.labels.len() as u32 * 2;
        if count > 0 {
            encoder.resolve_query_set(&self.queries, 0..count, &self.resolved, 0);
            encoder.copy_buffer_to_buffer(&self.resolved, 0, &self.staging, 0, u64::from(count) * 8);
        }
    }

    /// Waits for the submission and adds its stages to the sums, all under the name `group` if one is given.
    ///
    /// # Errors
    /// When the device was lost.
    pub fn collect(&mut self, gpu: &Gpu, group: Option<&str>) -> Result<()> {
        let count = self.labels.len();
        if count == 0 {
            return Ok(());
        }
        self.staging.map_async(wgpu::MapMode::Read, 0..(count * 16) as u64, |_| {});
        gpu.wait()?;
        let ticks: Vec<u64> = {
            let mapped = self.staging.get_mapped_range(0..(count * 16) as u64)?;
            bytemuck::pod_collect_to_vec(&mapped)
        };
        self.staging.unmap();
        for (label, pair) in self.labels.drain(..).zip(ticks.chunks_exact(2)) {
            let seconds = pair[1].saturating_sub(pair[0]) as f64 * self.period_ns * 1e-9;
            *self.totals.entry(group.map_or(label, str::to_owned)).or_default() += seconds;
        }
        Ok(())
    }

    /// Seconds per stage so far.
    #[must_use]
    pub fn totals(&self) -> &BTreeMap<String, f64> {
        &self.totals
    }
}
