//! What a device did for a build.

use serde::Serialize;

/// What a device did for a build.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct DeviceReport {
    /// Its name.
    pub name: String,
    /// Bricks that it evaluated.
    pub bricks: u64,
    /// Bricks of the same trees that the processor evaluated, because the device failed or had no room for them.
    pub cpu_bricks: u64,
    /// Batches in which the device did its part.
    pub batches: u64,
    /// Batches that were tried again with less.
    pub retries: u64,
    /// The most bytes that were allocated on the device, and here for it, since it was opened.
    pub peak_bytes: u64,
    /// Seconds of the device's clock for uploads, if it has one.
    pub upload_seconds: f64,
    /// Seconds for kernels: which lines pass through which triangle, jumps, samples, sign-changing edges, those of them with
    /// several crossings.
    pub kernel_seconds: [f64; 5],
    /// Seconds for sums over the caps of an open soup.
    pub sum_seconds: f64,
    /// Samples of open soups that it was asked for.
    pub samples: u64,
    /// Those of them that the processor settled.
    pub settled: u64,
    /// Seconds for read-backs.
    pub read_seconds: f64,
    /// Bricks of the device that the processor computed as well.
    pub checked: u64,
    /// The first thing that went wrong.
    pub failure: Option<String>,
    /// The first brick that was not the processor's, in one line. Then the store has none of the device's bricks.
    pub wrong: Option<String>,
}
