//! A build that is begun anew because its device was caught with a wrong brick.

use super::options::{BuildOptions, CommitOptions};
use super::resources::Resources;
use super::summary::BuildSummary;
use crate::backend::Vulkan;
use crate::error::{Error, Result};

/// Builds on the device that the options have, and on the processor alone if that computes otherwise than the processor.
///
/// Which of its other bricks are wrong nobody knows: those that were not computed twice, those of batches before, and those
/// that an interrupted run has left. So the first build gives up all of its file, and the second begins with an empty one.
pub(super) fn without_wrong_device(
    options: &BuildOptions,
    build: impl Fn(&BuildOptions) -> Result<BuildSummary>,
) -> Result<BuildSummary> {
    let done = build(options);
    let device = options.resources.device.as_ref().map(Vulkan::take_report);
    match done {
        Err(Error::Distrusted { .. }) => {
            let resources = Resources { device: None, ..options.resources.clone() };
            let keeping = CommitOptions { restart: true, ..options.keeping.clone() };
            let summary = build(&BuildOptions { resources, keeping, ..options.clone() })?;
            Ok(BuildSummary { device, ..summary })
        }
        done => Ok(BuildSummary { device, ..done? }),
    }
}
