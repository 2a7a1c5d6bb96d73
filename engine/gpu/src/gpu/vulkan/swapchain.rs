//! The images of a window that are shown in turn, and host memory as large as one of them.

use super::failure::DeviceFailure;
use super::screen::PresentDevice;
use ash::vk;
use std::rc::Rc;

/// Images of one size. Made anew whenever the window has another.
pub(super) struct Swapchain {
    screen: Rc<PresentDevice>,
    pub raw: vk::SwapchainKHR,
    pub images: Vec<vk::Image>,
    /// For each image, signalled when its pixels are there.
    pub done: Vec<vk::Semaphore>,
    /// Width and height in pixels.
    pub extent: [u32; 2],
    /// Whether blue comes first in the bytes of a pixel.
    pub is_bgra: bool,
}

impl Swapchain {
    /// Images for a window of `size` pixels, unless the surface knows its size better; `None` while it has none, as that
    /// of a minimised window. Takes the place of `old`, of which nothing is in use.
    pub fn new(
        screen: &Rc<PresentDevice>,
        size: [u32; 2],
        old: Option<&Swapchain>,
    ) -> Result<Option<Swapchain>, DeviceFailure> {
        let (physical, surface) = (screen.physical, screen.surface);
        // SAFETY: device and surface belong together.
        let (able, formats) = unsafe {
            let able = screen.surfaces.get_physical_device_surface_capabilities(physical, surface)?;
            (able, screen.surfaces.get_physical_device_surface_formats(physical, surface)?)
        };
        let extent = extent(&able, size);
        if extent.contains(&0) {
            return Ok(None);
        }
        let format = pick(&formats).ok_or(DeviceFailure::Refused(vk::Result::ERROR_FORMAT_NOT_SUPPORTED))?;
        if !able.supported_usage_flags.contains(vk::ImageUsageFlags::TRANSFER_DST) {
            return Err(DeviceFailure::Refused(vk::Result::ERROR_FEATURE_NOT_PRESENT));
        }
        let alpha = [
            vk::CompositeAlphaFlagsKHR::OPAQUE,
            vk::CompositeAlphaFlagsKHR::INHERIT,
            vk::CompositeAlphaFlagsKHR::POST_MULTIPLIED,
        ];
        let alpha = alpha.into_iter().find(|alpha| able.supported_composite_alpha.contains(*alpha));
        // One more than needed, so that one is free while the others wait for the screen.
        let most = if able.max_image_count == 0 { u32::MAX } else { able.max_image_count };
        let info = vk::SwapchainCreateInfoKHR::default()
            .surface(surface)
            .min_image_count((able.min_image_count + 1).min(most))
            .image_format(format.format)
            .image_color_space(format.color_space)
            .image_extent(vk::Extent2D { width: extent[0], height: extent[1] })
            .image_array_layers(1)
            .image_usage(vk::ImageUsageFlags::TRANSFER_DST)
            .image_sharing_mode(vk::SharingMode::EXCLUSIVE)
            .pre_transform(able.current_transform)
            .composite_alpha(alpha.unwrap_or(vk::CompositeAlphaFlagsKHR::PRE_MULTIPLIED))
            // The one that every device has.
            .present_mode(vk::PresentModeKHR::FIFO)
            .clipped(true)
            .old_swapchain(old.map_or(vk::SwapchainKHR::null(), |old| old.raw));
        // SAFETY: the settings are among those that the surface has, and `old` is its swapchain so far.
        let raw = unsafe { screen.functions.create_swapchain(&info, None) }?;
        // From here on `drop` cleans up after a failure.
        let mut made = Swapchain {
            screen: Rc::clone(screen),
            raw,
            images: Vec::new(),
            done: Vec::new(),
            extent,
            is_bgra: format.format == vk::Format::B8G8R8A8_UNORM,
        };
        // SAFETY: the swapchain was just made; the semaphores are destroyed with it.
        unsafe {
            made.images = screen.functions.get_swapchain_images(raw)?;
            for _ in 0..made.images.len() {
                made.done.push(screen.raw.create_semaphore(&vk::SemaphoreCreateInfo::default(), None)?);
            }
        }
        Ok(Some(made))
    }
}

impl Drop for Swapchain {
    fn drop(&mut self) {
        // SAFETY: the owner has waited for the device, so that neither images nor semaphores are in use.
        unsafe {
            self.done.iter().for_each(|done| self.screen.raw.destroy_semaphore(*done, None));
            self.screen.functions.destroy_swapchain(self.raw, None);
        }
    }
}

/// The size that images must have.
fn extent(able: &vk::SurfaceCapabilitiesKHR, size: [u32; 2]) -> [u32; 2] {
    let (now, low, high) = (able.current_extent, able.min_image_extent, able.max_image_extent);
    if now.width != u32::MAX {
        return [now.width, now.height];
    }
    [size[0].min(high.width).max(low.width), size[1].min(high.height).max(low.height)]
}

/// A format that shows bytes of sRGB as they are.
fn pick(formats: &[vk::SurfaceFormatKHR]) -> Option<vk::SurfaceFormatKHR> {
    let known = [vk::Format::B8G8R8A8_UNORM, vk::Format::R8G8B8A8_UNORM];
    let suits = |f: &&vk::SurfaceFormatKHR| f.color_space == vk::ColorSpaceKHR::SRGB_NONLINEAR;
    known.into_iter().find_map(|known| formats.iter().filter(suits).find(|f| f.format == known).copied())
}

/// Host memory from which the device copies.
pub(super) struct Staging {
    screen: Rc<PresentDevice>,
    pub buffer: vk::Buffer,
    memory: vk::DeviceMemory,
    mapped: *mut u8,
    pub size: usize,
}

impl Staging {
    /// Room for so many bytes, at least one.
    pub fn new(screen: &Rc<PresentDevice>, size: usize) -> Result<Staging, DeviceFailure> {
        // Filled as soon as something is made, so that `drop` cleans up after a failure.
        let mut staging = Staging {
            screen: Rc::clone(screen),
            buffer: vk::Buffer::null(),
            memory: vk::DeviceMemory::null(),
            mapped: std::ptr::null_mut(),
            size,
        };
        let device = &screen.raw;
        let info =
            vk::BufferCreateInfo::default().size(size as u64).usage(vk::BufferUsageFlags::TRANSFER_SRC);
        // SAFETY: the device is alive; what is made is destroyed in `drop`.
        let needs = unsafe {
            staging.buffer = device.create_buffer(&info, None)?;
            device.get_buffer_memory_requirements(staging.buffer)
        };
        let visible = vk::MemoryPropertyFlags::HOST_VISIBLE | vk::MemoryPropertyFlags::HOST_COHERENT;
        let types = screen.memory.memory_types_as_slice();
        let kind = (0..types.len())
            .find(|&n| needs.memory_type_bits >> n & 1 != 0 && types[n].property_flags.contains(visible));
        let kind = kind.ok_or(DeviceFailure::OutOfMemory)? as u32;
        let info = vk::MemoryAllocateInfo::default().allocation_size(needs.size).memory_type_index(kind);
        // SAFETY: the type is one that the buffer may have and that can be mapped; it is bound and mapped once.
        unsafe {
            staging.memory = device.allocate_memory(&info, None)?;
            device.bind_buffer_memory(staging.buffer, staging.memory, 0)?;
            let all = vk::MemoryMapFlags::empty();
            staging.mapped = device.map_memory(staging.memory, 0, vk::WHOLE_SIZE, all)?.cast();
        }
        Ok(staging)
    }

    /// Its bytes, which the device must not be reading.
    pub fn bytes_mut(&mut self) -> &mut [u8] {
        // SAFETY: so many bytes are mapped here, they are this structure's alone, and any bytes are bytes.
        unsafe { std::slice::from_raw_parts_mut(self.mapped, self.size) }
    }
}

impl Drop for Staging {
    fn drop(&mut self) {
        // SAFETY: the owner has waited for the device. Destroying nothing is allowed.
        unsafe {
            self.screen.raw.destroy_buffer(self.buffer, None);
            self.screen.raw.free_memory(self.memory, None);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_surface_knows_its_size_or_takes_ours() {
        let of = |width, height| vk::Extent2D { width, height };
        let mut able = vk::SurfaceCapabilitiesKHR {
            current_extent: of(640, 480),
            min_image_extent: of(16, 16),
            max_image_extent: of(4096, 4096),
            ..Default::default()
        };
        assert_eq!(extent(&able, [1, 2]), [640, 480]);
        able.current_extent = of(u32::MAX, u32::MAX);
        assert_eq!(extent(&able, [1, 9999]), [16, 4096]);
    }

    #[test]
    fn only_formats_that_keep_bytes_are_taken() {
        let of = |format, color_space| vk::SurfaceFormatKHR { format, color_space };
        let srgb = vk::ColorSpaceKHR::SRGB_NONLINEAR;
        let wide = of(vk::Format::R8G8B8A8_UNORM, vk::ColorSpaceKHR::DISPLAY_P3_NONLINEAR_EXT);
        let linear = of(vk::Format::B8G8R8A8_SRGB, srgb);
        let plain = of(vk::Format::R8G8B8A8_UNORM, srgb);
        assert_eq!(pick(&[wide, linear, plain]), Some(plain));
        assert_eq!(pick(&[wide, linear]), None);
    }
}
