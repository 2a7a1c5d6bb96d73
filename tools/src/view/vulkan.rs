//! Pictures by a device, which get better as bricks come to it.

use super::painter::{
    CpuPainter, Painter, PixelSource, Rows, StopConditions, first, in_rows, next_coarseness,
};
use super::session::Shot;
use crate::output::warn;
use brickfield_engine::gpu::Gpu;
use brickfield_engine::render::{Caster, RenderOptions};
use brickfield_engine::{Error, Progress};
use std::time::{Duration, Instant};

/// Sides of the pixels of a first picture, in pixels of the window; the largest for the very first one.
const COARSENESS: [u32; 2] = [1, 16];
/// How long the first picture may wait for bricks: half of its time, for its rays take some of it.
const FIRST_WAIT: Duration = Duration::from_millis(20);
/// How long a picture may wait for bricks before it is shown with coarser ones in their places; twice as long each further
/// time, so that a device that is slow with rays spends most of its time on what stays.
const WAIT: Duration = Duration::from_millis(150);

/// A device, by rays.
pub struct VulkanPainter<'a> {
    caster: Caster<'a>,
    /// Paints what is too close for the device's single precision, and in its place when it fails.
    here: CpuPainter<'a>,
    coarseness: u32,
    /// Whether the device's failure was told.
    told: bool,
}

impl<'a> VulkanPainter<'a> {
    /// Paints on a device what `here` paints.
    pub fn new(here: CpuPainter<'a>, gpu: &Gpu) -> VulkanPainter<'a> {
        let caster = Caster::new(&here.scene, gpu);
        VulkanPainter { caster, here, coarseness: COARSENESS[1], told: false }
    }

    /// Paints a shot on the device, but for one that it cannot paint: false, also if it fails.
    fn cast(
        &mut self,
        shot: &Shot,
        until: StopConditions<'_>,
        show: &mut dyn FnMut(Rows<'_>),
    ) -> Result<bool, Error> {
        let whole = self.here.options(shot);
        if self.caster.has_failed()
            || self.here.tint(shot).is_some()
            || !self.here.scene_of(&whole, None)?.frames().all(|frame| Caster::resolves(&frame))
        {
            return Ok(false);
        }
        let started = Instant::now();
        let coarse = first(&whole, self.coarseness);
        self.step(&coarse, Some(started + FIRST_WAIT), until.over, show)?;
        if self.caster.has_failed() {
            return Ok(false);
        }
        self.coarseness = next_coarseness(self.coarseness, COARSENESS, started.elapsed());
        let single = RenderOptions { supersample: 1, ..whole.clone() };
        let (mut wait, before) = (WAIT, self.caster.report().brought);
        let is_complete = loop {
            let last = self.caster.report().brought;
            let is_complete = self.step(&single, Some(Instant::now() + wait), until.another, show)?;
            let report = self.caster.report();
            if self.caster.has_failed() {
                return Ok(false);
            }
            // Where there is no room for all bricks together, sketches would come and go for ever.
            let is_full = report.brought - before > report.pages.into();
            if is_complete || is_full || report.brought == last {
                break is_complete;
            }
            wait *= 2;
        };
        if !is_complete || whole.supersample > 1 {
            self.step(&whole, None, until.another, show)?;
        }
        Ok(!self.caster.has_failed())
    }

    /// Draws one step of a shot, waiting for bricks until `deadline`; whether it has them all.
    fn step(
        &mut self,
        options: &RenderOptions,
        deadline: Option<Instant>,
        stop: &dyn Progress,
        show: &mut dyn FnMut(Rows<'_>),
    ) -> Result<bool, Error> {
        let mut is_complete = true;
        for frame in self.here.scene_of(options, None)?.frames() {
            let row = in_rows(options.size, show);
            match deadline {
                Some(deadline) => is_complete &= self.caster.sketch(&frame, deadline, stop, row)?,
                None => self.caster.draw(&frame, stop, row)?,
            }
        }
        Ok(is_complete)
    }

    /// Says that the device has failed, once.
    fn tell(&mut self) {
        let report = self.caster.report();
        if let Some(failure) = report.failure.as_ref().filter(|_| !self.told) {
            warn(&format!("{}: {failure}; the processor draws in its place", report.name));
            self.told = true;
        }
    }
}

impl Painter for VulkanPainter<'_> {
    fn paint(
        &mut self,
        shot: &Shot,
        until: StopConditions<'_>,
        show: &mut dyn FnMut(Rows<'_>),
    ) -> Result<PixelSource, Error> {
        let is_cast = self.cast(shot, until, show);
        self.tell();
        if is_cast? {
            return Ok(PixelSource::Device);
        }
        let by = self.here.paint(shot, until, show)?;
        // What is too close is the processor's in `render --backend vulkan`, too; what was found has no such option.
        let is_ours = self.caster.has_failed() || self.here.tint(shot).is_some();
        Ok(if is_ours { by } else { PixelSource::Device })
    }
}
