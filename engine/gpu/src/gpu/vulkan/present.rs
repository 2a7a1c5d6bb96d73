//! Pictures of the host's memory shown in a window.

use super::failure::{DeviceFailure, DeviceUnavailable};
use super::info::DeviceInfo;
use super::screen::PresentDevice;
use super::swapchain::{Staging, Swapchain};
use ash::vk;
use raw_window_handle::{HasDisplayHandle, HasWindowHandle};
use std::rc::Rc;
use std::sync::Arc;

/// How long the window may stand still for the device: some frames of a screen. One that is off gives no image for ever.
const PATIENCE_NS: u64 = 100_000_000;
/// Attempts at a picture while the window changes its size.
const ATTEMPTS: usize = 3;

/// What became of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PresentOutcome {
    /// It is shown.
    Shown,
    /// The window has no area in which anything could be shown.
    NoArea,
    /// Device or system are not ready for it, or the window keeps changing; to be shown again.
    NotYet,
}

/// Shows pictures in a window, one after the other: each is written to memory that the device reads, and copied from there
/// into an image of the window.
pub struct Presenter {
    screen: Rc<PresentDevice>,
    swapchain: Option<Swapchain>,
    /// Whether the window has changed since its images were made.
    stale: bool,
    staging: Option<Staging>,
    pool: vk::CommandPool,
    commands: vk::CommandBuffer,
    /// Signalled when an image may be written.
    acquired: vk::Semaphore,
    /// Signalled when the last copy is done.
    copied: vk::Fence,
}

impl Presenter {
    /// Takes the window, which stays open as long as this lives, and the best device that shows pictures in it.
    ///
    /// # Errors
    /// If there is no Vulkan, or no device that draws in this window.
    pub fn new<W>(window: Arc<W>) -> Result<Presenter, DeviceUnavailable>
    where
        W: HasDisplayHandle + HasWindowHandle + 'static,
    {
        let screen = Rc::new(PresentDevice::new(window)?);
        let name = screen.info.name.clone();
        let mut presenter = Presenter {
            screen,
            swapchain: None,
            stale: false,
            staging: None,
            pool: vk::CommandPool::null(),
            commands: vk::CommandBuffer::null(),
            acquired: vk::Semaphore::null(),
            copied: vk::Fence::null(),
        };
        presenter.prepare().map_err(|failure| {
            DeviceUnavailable::new(format!("{name}: {failure}"), "update the GPU's Vulkan driver")
        })?;
        Ok(presenter)
    }

    fn prepare(&mut self) -> Result<(), DeviceFailure> {
        let device = &self.screen.raw;
        let pool = vk::CommandPoolCreateInfo::default()
            .queue_family_index(self.screen.family)
            .flags(vk::CommandPoolCreateFlags::RESET_COMMAND_BUFFER);
        let signalled = vk::FenceCreateInfo::default().flags(vk::FenceCreateFlags::SIGNALED);
        // SAFETY: the device is alive and has the family; what is made is destroyed in `drop`.
        unsafe {
            self.pool = device.create_command_pool(&pool, None)?;
            let one =
                vk::CommandBufferAllocateInfo::default().command_pool(self.pool).command_buffer_count(1);
            self.commands = device.allocate_command_buffers(&one)?[0];
            self.acquired = device.create_semaphore(&vk::SemaphoreCreateInfo::default(), None)?;
            self.copied = device.create_fence(&signalled, None)?;
        }
        Ok(())
    }

    /// The device that shows the pictures.
    pub fn info(&self) -> &DeviceInfo {
        &self.screen.info
    }

    /// Shows a picture of `size` (width, height) pixels, rows from the top, sRGB without regard to opacity. Where the
    /// window is smaller for a moment it is cut off, where larger the rest is black. Takes a tenth of a second at most, but
    /// for making images of another size.
    ///
    /// # Errors
    /// If the device fails for good.
    pub fn show(&mut self, size: [u32; 2], pixels: &[[u8; 4]]) -> Result<PresentOutcome, DeviceFailure> {
        assert_eq!(size[0] as usize * size[1] as usize, pixels.len(), "a picture has as many pixels");
        for _ in 0..ATTEMPTS {
            // What the last picture was copied from is written anew, and its semaphore waited for again.
            if !self.has_copied()? {
                return Ok(PresentOutcome::NotYet);
            }
            if self.stale || self.swapchain.as_ref().is_none_or(|chain| chain.extent != size) {
                self.renew(size)?;
            }
            let Some(chain) = &self.swapchain else { return Ok(PresentOutcome::NoArea) };
            let functions = &self.screen.functions;
            // SAFETY: the swapchain is alive, and nobody waits for the semaphore or will signal it.
            let next = unsafe {
                functions.acquire_next_image(chain.raw, PATIENCE_NS, self.acquired, vk::Fence::null())
            };
            let (image, is_poor) = match next {
                Ok(next) => next,
                Err(vk::Result::ERROR_OUT_OF_DATE_KHR) => {
                    self.stale = true;
                    continue;
                }
                Err(vk::Result::TIMEOUT | vk::Result::NOT_READY) => return Ok(PresentOutcome::NotYet),
                Err(result) => return Err(result.into()),
            };
            self.write(size, pixels);
            self.stale = is_poor;
            if self.submit(image)? {
                return Ok(PresentOutcome::Shown);
            }
            self.stale = true;
        }
        Ok(PresentOutcome::NotYet)
    }

    /// Waits for the last copy; whether it is done.
    fn has_copied(&self) -> Result<bool, DeviceFailure> {
        // SAFETY: the fence is the device's, and signalled or to be signalled by a submission.
        match unsafe { self.screen.raw.wait_for_fences(&[self.copied], true, PATIENCE_NS) } {
            Ok(()) => Ok(true),
            Err(vk::Result::TIMEOUT) => Ok(false),
            Err(result) => Err(result.into()),
        }
    }

    /// Makes images for a window of this size, and room for one of them.
    fn renew(&mut self, size: [u32; 2]) -> Result<(), DeviceFailure> {
        // The last copy is done, so that nothing is left but to show it.
        // SAFETY: only this structure uses the device.
        unsafe { self.screen.raw.device_wait_idle() }?;
        let made = Swapchain::new(&self.screen, size, self.swapchain.as_ref())?;
        self.swapchain = made;
        self.stale = false;
        let Some(chain) = &self.swapchain else { return Ok(()) };
        let bytes = chain.extent[0] as usize * chain.extent[1] as usize * 4;
        if self.staging.as_ref().is_none_or(|staging| staging.size != bytes) {
            self.staging = None;
            self.staging = Some(Staging::new(&self.screen, bytes)?);
        }
        Ok(())
    }

    /// Puts the picture into the memory that is copied.
    fn write(&mut self, size: [u32; 2], pixels: &[[u8; 4]]) {
        let (Some(chain), Some(staging)) = (&self.swapchain, &mut self.staging) else { return };
        let bytes = staging.bytes_mut().as_chunks_mut::<4>().0;
        let order = if chain.is_bgra { [2, 1, 0, 3] } else { [0, 1, 2, 3] };
        for (y, row) in bytes.chunks_exact_mut(chain.extent[0] as usize).enumerate() {
            let from = y * size[0] as usize;
            let seen = pixels.get(from..from + size[0] as usize).unwrap_or(&[]);
            let seen = &seen[..seen.len().min(row.len())];
            let (left, rest) = row.split_at_mut(seen.len());
            left.iter_mut().zip(seen).for_each(|(to, from)| *to = order.map(|channel| from[channel]));
            rest.fill([0, 0, 0, 255]);
        }
    }

    /// Copies what was written into the image and shows it; false if the window has changed meanwhile.
    fn submit(&mut self, number: u32) -> Result<bool, DeviceFailure> {
        let Some(chain) = &self.swapchain else { return Ok(false) };
        let (image, done) = (chain.images[number as usize], chain.done[number as usize]);
        self.record(image, chain.extent)?;
        let (commands, wait, signal) = ([self.commands], [self.acquired], [done]);
        let stages = [vk::PipelineStageFlags::TRANSFER];
        let copy = vk::SubmitInfo::default()
            .command_buffers(&commands)
            .wait_semaphores(&wait)
            .wait_dst_stage_mask(&stages)
            .signal_semaphores(&signal);
        let (chains, numbers) = ([chain.raw], [number]);
        let show = vk::PresentInfoKHR::default()
            .wait_semaphores(&signal)
            .swapchains(&chains)
            .image_indices(&numbers);
        let (device, queue) = (&self.screen.raw, self.screen.queue);
        // SAFETY: the fence is signalled and nobody waits for it; the commands are recorded and not pending; `acquired` is
        // signalled by the acquisition of this image, whose last presentation has waited for `done`; and the image is shown
        // only behind the copy. All of it lives until the next wait.
        let shown = unsafe {
            device.reset_fences(&[self.copied])?;
            device.queue_submit(queue, &[copy], self.copied)?;
            self.screen.functions.queue_present(queue, &show)
        };
        match shown {
            Ok(is_poor) => {
                self.stale |= is_poor;
                Ok(true)
            }
            Err(vk::Result::ERROR_OUT_OF_DATE_KHR) => Ok(false),
            Err(result) => Err(result.into()),
        }
    }

    /// Commands that fill the image.
    fn record(&self, image: vk::Image, extent: [u32; 2]) -> Result<(), DeviceFailure> {
        let Some(staging) = &self.staging else { return Ok(()) };
        let (device, commands) = (&self.screen.raw, self.commands);
        let whole = vk::ImageSubresourceRange {
            aspect_mask: vk::ImageAspectFlags::COLOR,
            level_count: 1,
            layer_count: 1,
            ..Default::default()
        };
        let barrier = vk::ImageMemoryBarrier::default()
            .src_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
            .dst_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
            .image(image)
            .subresource_range(whole);
        // Whatever it showed before is lost.
        let before = barrier
            .dst_access_mask(vk::AccessFlags::TRANSFER_WRITE)
            .old_layout(vk::ImageLayout::UNDEFINED)
            .new_layout(vk::ImageLayout::TRANSFER_DST_OPTIMAL);
        let behind = barrier
            .src_access_mask(vk::AccessFlags::TRANSFER_WRITE)
            .old_layout(vk::ImageLayout::TRANSFER_DST_OPTIMAL)
            .new_layout(vk::ImageLayout::PRESENT_SRC_KHR);
        let layers = vk::ImageSubresourceLayers {
            aspect_mask: vk::ImageAspectFlags::COLOR,
            layer_count: 1,
            ..Default::default()
        };
        let region = vk::BufferImageCopy::default().image_subresource(layers).image_extent(vk::Extent3D {
            width: extent[0],
            height: extent[1],
            depth: 1,
        });
        let once = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
        let (transfer, end) = (vk::PipelineStageFlags::TRANSFER, vk::PipelineStageFlags::BOTTOM_OF_PIPE);
        let none = vk::DependencyFlags::empty();
        // SAFETY: the commands are not pending, for the fence was waited for; buffer and image are of the same extent. The
        // first barrier waits for the stage at which the submission waits for the image.
        unsafe {
            device.begin_command_buffer(commands, &once)?;
            device.cmd_pipeline_barrier(commands, transfer, transfer, none, &[], &[], &[before]);
            let layout = vk::ImageLayout::TRANSFER_DST_OPTIMAL;
            device.cmd_copy_buffer_to_image(commands, staging.buffer, image, layout, &[region]);
            device.cmd_pipeline_barrier(commands, transfer, end, none, &[], &[], &[behind]);
            device.end_command_buffer(commands)?;
        }
        Ok(())
    }
}

impl Drop for Presenter {
    fn drop(&mut self) {
        let device = &self.screen.raw;
        // SAFETY: only this structure uses the device. If it is lost, nothing of it runs any more. Destroying nothing is
        // allowed.
        unsafe {
            let _ = device.device_wait_idle();
            self.swapchain = None;
            self.staging = None;
            device.destroy_semaphore(self.acquired, None);
            device.destroy_fence(self.copied, None);
            device.destroy_command_pool(self.pool, None);
        }
    }
}
