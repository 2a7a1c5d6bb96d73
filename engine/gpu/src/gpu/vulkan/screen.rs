//! A window as Vulkan sees it: the surface, and a device that can show pictures on it.

use super::failure::DeviceUnavailable;
use super::info::{DeviceInfo, DeviceKind};
use super::instance::Instance;
use ash::khr::{surface, swapchain, xlib_surface};
use ash::vk;
use raw_window_handle::{
    HasDisplayHandle, HasWindowHandle, RawDisplayHandle, RawWindowHandle, XlibDisplayHandle, XlibWindowHandle,
};
use std::any::Any;
use std::sync::Arc;

const REMEDY: &str = "update the GPU's Vulkan driver";

/// A device of its own: it need not be able to run the kernels.
pub(super) struct PresentDevice {
    pub raw: ash::Device,
    pub functions: swapchain::Device,
    pub physical: vk::PhysicalDevice,
    pub info: DeviceInfo,
    pub family: u32,
    pub queue: vk::Queue,
    pub surface: vk::SurfaceKHR,
    pub surfaces: surface::Instance,
    pub memory: vk::PhysicalDeviceMemoryProperties,
    // Dropped in this order, behind the device and the surface.
    _instance: Instance,
    /// The window must outlive its surface.
    _window: Arc<dyn Any>,
}

/// A device with the family of queues that draws on a surface.
struct Candidate {
    physical: vk::PhysicalDevice,
    info: DeviceInfo,
    family: u32,
}

impl PresentDevice {
    /// The surface of a window, on the best device that shows it.
    pub fn new<W>(window: Arc<W>) -> Result<PresentDevice, DeviceUnavailable>
    where
        W: HasDisplayHandle + HasWindowHandle + 'static,
    {
        let refused = |what: String| DeviceUnavailable::new(what, REMEDY);
        let no_handle = |error| refused(format!("the window cannot be drawn on ({error})"));
        let display = window.display_handle().map_err(no_handle)?.as_raw();
        let handle = window.window_handle().map_err(no_handle)?.as_raw();
        let (RawDisplayHandle::Xlib(display), RawWindowHandle::Xlib(handle)) = (display, handle) else {
            return Err(DeviceUnavailable::new("the window is none of X11", "set DISPLAY to an X server's"));
        };
        let instance = Instance::with(&[surface::NAME, xlib_surface::NAME], false)?;
        let surfaces = surface::Instance::new(&instance.entry, &instance.raw);
        // SAFETY: the instance has the extension, and the window belongs to the display; both live in the screen until
        // the surface is destroyed.
        let surface = unsafe { surface_of(&instance, display, handle) };
        let surface = surface.map_err(|result| refused(format!("the window has no surface ({result})")))?;
        let opened = open(&instance, &surfaces, surface);
        let (chosen, raw) = opened.inspect_err(|_| {
            // SAFETY: nothing was made of the surface.
            unsafe { surfaces.destroy_surface(surface, None) };
        })?;
        let Candidate { physical, info, family } = chosen;
        // SAFETY: the family was asked for, with one queue; the physical device is the instance's.
        let (queue, memory) = unsafe {
            let memory = instance.raw.get_physical_device_memory_properties(physical);
            (raw.get_device_queue(family, 0), memory)
        };
        let functions = swapchain::Device::new(&instance.raw, &raw);
        Ok(PresentDevice {
            raw,
            functions,
            physical,
            info,
            family,
            queue,
            surface,
            surfaces,
            memory,
            _instance: instance,
            _window: window,
        })
    }
}

/// The surface of a window.
///
/// # Safety
/// The instance must have the extension of X11's windows, and the window be one of the display; both must live longer than
/// the surface.
unsafe fn surface_of(
    instance: &Instance,
    display: XlibDisplayHandle,
    window: XlibWindowHandle,
) -> Result<vk::SurfaceKHR, vk::Result> {
    let display = display.display.ok_or(vk::Result::ERROR_INITIALIZATION_FAILED)?.as_ptr();
    let info = vk::XlibSurfaceCreateInfoKHR::default().dpy(display.cast()).window(window.window);
    // SAFETY: as above; the handles are those of a window that is open.
    unsafe { xlib_surface::Instance::new(&instance.entry, &instance.raw).create_xlib_surface(&info, None) }
}

/// The best device that shows pictures on the surface, opened.
fn open(
    instance: &Instance,
    surfaces: &surface::Instance,
    surface: vk::SurfaceKHR,
) -> Result<(Candidate, ash::Device), DeviceUnavailable> {
    let found = instance.physical_devices()?;
    let candidates = found.iter().enumerate().filter_map(|(number, &physical)| {
        let family = family(instance, surfaces, surface, physical)?;
        Some(Candidate { physical, info: instance.describe(number, physical), family })
    });
    let rank = |c: &Candidate| (c.info.kind == DeviceKind::Other, c.info.kind, c.info.index);
    let chosen = candidates
        .min_by_key(rank)
        .ok_or_else(|| DeviceUnavailable::new("no Vulkan device shows pictures in windows", REMEDY))?;
    let priorities = [1.0];
    let queues = [vk::DeviceQueueCreateInfo::default()
        .queue_family_index(chosen.family)
        .queue_priorities(&priorities)];
    let extensions = [swapchain::NAME.as_ptr()];
    let create =
        vk::DeviceCreateInfo::default().queue_create_infos(&queues).enabled_extension_names(&extensions);
    // SAFETY: the device has the family and the extension; what `create` points to lives until the call returns.
    let opened = unsafe { instance.raw.create_device(chosen.physical, &create, None) };
    let raw = opened.map_err(|result| {
        DeviceUnavailable::new(
            format!("{}: the device cannot be opened ({result})", chosen.info.name),
            REMEDY,
        )
    })?;
    Ok((chosen, raw))
}

/// A family of queues of the device that draws on the surface, if it has swapchains at all.
fn family(
    instance: &Instance,
    surfaces: &surface::Instance,
    surface: vk::SurfaceKHR,
    physical: vk::PhysicalDevice,
) -> Option<u32> {
    // SAFETY: the device is the instance's.
    let (extensions, families) = unsafe {
        let extensions = instance.raw.enumerate_device_extension_properties(physical).ok()?;
        (extensions, instance.raw.get_physical_device_queue_family_properties(physical))
    };
    let has_swapchains = |e: &vk::ExtensionProperties| e.extension_name_as_c_str() == Ok(swapchain::NAME);
    extensions.iter().find(|extension| has_swapchains(extension))?;
    // Either of these copies, too.
    let copies = vk::QueueFlags::GRAPHICS | vk::QueueFlags::COMPUTE;
    (0..families.len() as u32).find(|&family| {
        // SAFETY: device, family and surface are the instance's.
        let shows = unsafe { surfaces.get_physical_device_surface_support(physical, family, surface) };
        families[family as usize].queue_flags.intersects(copies) && shows == Ok(true)
    })
}

impl Drop for PresentDevice {
    fn drop(&mut self) {
        // SAFETY: whatever was made on the device holds a reference to this, so nothing is left, and nothing runs:
        // its owners have waited. The surface has no swapchain any more.
        unsafe {
            self.raw.destroy_device(None);
            self.surfaces.destroy_surface(self.surface, None);
        }
    }
}
