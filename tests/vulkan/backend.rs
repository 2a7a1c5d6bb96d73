//! The backends under test.

use brickfield_core::sweep::part_or_all;
use brickfield_engine::backend::{DeviceReport, Vulkan};
use brickfield_engine::build::{BuildOptions, BuildSummary, Resolution, Resources, build_opened};
use brickfield_engine::gpu::{DeviceSettings, Gpu};
use brickfield_engine::ingest::Input;
use brickfield_engine::{Progress, Result, Silent};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, OnceLock};

/// Something that builds stores.
pub struct Backend {
    pub device: Option<Vulkan>,
    pub threads: usize,
    /// Whether the suite's deepest trees are worth their time.
    pub does_all: bool,
}

impl Backend {
    /// The processor or a device, for a part of the suite.
    pub fn new(device: Option<Vulkan>, threads: usize) -> Backend {
        Backend { device, threads, does_all: part_or_all(false, true) }
    }

    /// The store of an input.
    pub fn build_with(&self, input: &Input, depth: u8, options: &BuildOptions) -> (Vec<u8>, BuildSummary) {
        let directory = tempfile::tempdir().unwrap();
        let out = directory.path().join("part.brf");
        let options = BuildOptions { resolution: Resolution::Depth(depth), ..options.clone() };
        let summary = self.build_at(input, &out, &options, &Silent).unwrap_or_else(|e| panic!("{e}"));
        (std::fs::read(&out).unwrap(), summary)
    }

    /// Builds a file, or begins to.
    pub fn build_at(
        &self,
        input: &Input,
        out: &Path,
        options: &BuildOptions,
        progress: &dyn Progress,
    ) -> Result<BuildSummary> {
        let resources = Resources { device: self.device.clone(), ..options.resources.clone() };
        let options = BuildOptions { resources, ..options.clone() };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(self.threads).build().unwrap();
        pool.install(|| build_opened(std::slice::from_ref(input), out, &options, progress))
    }

    /// What the device did since it was last asked.
    pub fn report(&self) -> Option<DeviceReport> {
        self.device.as_ref().map(Vulkan::take_report)
    }
}

pub fn options(depth: u8) -> BuildOptions {
    BuildOptions { resolution: Resolution::Depth(depth), ..BuildOptions::default() }
}

/// The processor's store, on one thread.
pub fn reference(input: &Input, depth: u8) -> Arc<[u8]> {
    reference_with(input, depth, &options(depth))
}

/// The same with options. Several backends and several failures of a device are held against it: it is built once.
pub fn reference_with(input: &Input, depth: u8, options: &BuildOptions) -> Arc<[u8]> {
    type Stores = BTreeMap<(PathBuf, u8, String), Arc<OnceLock<Arc<[u8]>>>>;
    static BUILT: Mutex<Stores> = Mutex::new(Stores::new());
    let key = (input.path().to_owned(), depth, format!("{options:?}"));
    let built = Arc::clone(BUILT.lock().unwrap().entry(key).or_default());
    let build = || Backend::new(None, 1).build_with(input, depth, options).0.into();
    Arc::clone(built.get_or_init(build))
}

/// Runs a test on the processor. It is compared with itself: shallow trees tell as much.
pub fn cpu(test: fn(&Backend)) {
    test(&Backend::new(None, 3));
}

/// Runs a test on a Vulkan device with the validation layer.
pub fn vulkan(test: fn(&Backend)) {
    on_device(Backend { does_all: true, ..Backend::new(Some(open(0)), 2) }, test);
}

/// The same with copies to and from the device, which one whose memory is the host's does without. Kernels are the same.
pub fn staged(test: fn(&Backend)) {
    on_device(Backend::new(Some(open_staged(0)), 2), test);
}

fn on_device(backend: Backend, test: fn(&Backend)) {
    test(&backend);
    silent(&backend);
}

fn settings() -> DeviceSettings {
    DeviceSettings { validation: true, ..DeviceSettings::default() }
}

/// A device with so much memory for batches.
pub fn open(memory: u64) -> Vulkan {
    open_as(&DeviceSettings { memory, ..settings() })
}

/// The same with copies to and from the device.
pub fn open_staged(memory: u64) -> Vulkan {
    open_as(&DeviceSettings { memory, staging: true, ..settings() })
}

fn open_as(settings: &DeviceSettings) -> Vulkan {
    Vulkan::new(Gpu::open(settings).unwrap_or_else(|e| panic!("{e}")))
}

/// Fails if the validation layer said anything.
pub fn silent(backend: &Backend) {
    let messages = backend.device.as_ref().map_or(Vec::new(), |device| read(&device.gpu().messages()));
    assert!(messages.is_empty(), "{}", messages.join("\n"));
}

/// Messages so far.
pub fn read(messages: &Mutex<Vec<String>>) -> Vec<String> {
    messages.lock().unwrap().clone()
}
