//! The loader, the instance, and which devices there are.

use super::failure::DeviceUnavailable;
use super::info::{DeviceInfo, DeviceKind};
use ash::ext::{debug_utils, validation_features};
use ash::{Entry, vk};
use brickfield_shaders::WORKGROUP;
use std::ffi::{CStr, c_void};
use std::sync::{Arc, Mutex, PoisonError};

/// All devices of the machine, in the loader's order.
///
/// # Errors
/// If there is no loader, or it finds no driver.
pub fn devices() -> Result<Vec<DeviceInfo>, DeviceUnavailable> {
    let instance = Instance::new(false)?;
    Ok(instance.physical_devices()?.iter().enumerate().map(|(i, d)| instance.describe(i, *d)).collect())
}

const VALIDATION: &CStr = c"VK_LAYER_KHRONOS_validation";
const INSTALL: &str = "install the GPU's Vulkan driver or mesa-vulkan-drivers";

/// Storage buffers that the kernels bind.
const BUFFERS: u32 = brickfield_shaders::BRICK_BUFFERS.len() as u32;
/// Bytes that a workgroup shares: what `evaluate` knows of a brick's rows and columns takes 9.5 KB.
const SHARED_BYTES: u32 = 10 << 10;

/// The loader with an instance.
pub(super) struct Instance {
    // Dropped last: the library with all functions.
    pub entry: Entry,
    pub raw: ash::Instance,
    validation: Option<Validation>,
}

/// The validation layer's messages.
struct Validation {
    functions: debug_utils::Instance,
    messenger: vk::DebugUtilsMessengerEXT,
    messages: Arc<Messages>,
}

/// What the validation layer said.
pub(super) type Messages = Mutex<Vec<String>>;

impl Instance {
    /// Loads Vulkan. With `validation` the Khronos validation layer looks on, if it is installed, and must be.
    pub fn new(validation: bool) -> Result<Instance, DeviceUnavailable> {
        Instance::with(&[], validation)
    }

    /// The same with extensions of the instance.
    pub fn with(extensions: &[&CStr], validation: bool) -> Result<Instance, DeviceUnavailable> {
        // SAFETY: the loader's initialization has no preconditions but that its library is Vulkan's, whose name this is.
        let entry = unsafe { Entry::load() }.map_err(|e| {
            DeviceUnavailable::new(format!("there is no Vulkan loader ({e})"), "install libvulkan1")
        })?;
        let application = vk::ApplicationInfo::default()
            .application_name(c"brickfield")
            .engine_name(c"brickfield")
            .api_version(vk::API_VERSION_1_2);
        let layers = [VALIDATION.as_ptr()];
        let mut extensions: Vec<_> = extensions.iter().map(|name| name.as_ptr()).collect();
        if validation {
            extensions.extend([debug_utils::NAME.as_ptr(), validation_features::NAME.as_ptr()]);
        }
        // Synchronization is checked as well: no driver on one processor would show a missing barrier.
        let checks = [vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION];
        let mut features = vk::ValidationFeaturesEXT::default().enabled_validation_features(&checks);
        let mut info = vk::InstanceCreateInfo::default()
            .application_info(&application)
            .enabled_extension_names(&extensions);
        if validation {
            info = info.enabled_layer_names(&layers).push_next(&mut features);
        }
        // SAFETY: everything that `info` points to lives until the call returns.
        let raw = unsafe { entry.create_instance(&info, None) }.map_err(|result| match result {
            vk::Result::ERROR_LAYER_NOT_PRESENT => DeviceUnavailable::new(
                "the Vulkan validation layer is not there",
                "install vulkan-validationlayers",
            ),
            vk::Result::ERROR_EXTENSION_NOT_PRESENT if validation => DeviceUnavailable::new(
                "the Vulkan validation layer cannot report",
                "install a newer vulkan-validationlayers",
            ),
            vk::Result::ERROR_EXTENSION_NOT_PRESENT => {
                DeviceUnavailable::new("the Vulkan drivers show no windows", "install another Vulkan driver")
            }
            result => DeviceUnavailable::new(format!("there is no Vulkan driver ({result})"), INSTALL),
        })?;
        let mut instance = Instance { entry, raw, validation: None };
        if validation {
            instance.listen()?;
        }
        Ok(instance)
    }

    /// Collects what the validation layer has to say.
    fn listen(&mut self) -> Result<(), DeviceUnavailable> {
        let functions = debug_utils::Instance::new(&self.entry, &self.raw);
        let messages: Arc<Messages> = Arc::default();
        let info = vk::DebugUtilsMessengerCreateInfoEXT::default()
            .message_severity(
                vk::DebugUtilsMessageSeverityFlagsEXT::ERROR | vk::DebugUtilsMessageSeverityFlagsEXT::WARNING,
            )
            .message_type(
                vk::DebugUtilsMessageTypeFlagsEXT::VALIDATION
                    | vk::DebugUtilsMessageTypeFlagsEXT::PERFORMANCE,
            )
            .pfn_user_callback(Some(keep_message))
            .user_data(std::ptr::from_ref::<Messages>(&messages).cast_mut().cast());
        // SAFETY: `messages` stays where it is, behind its counter, until the messenger is destroyed in `drop`.
        let messenger = unsafe { functions.create_debug_utils_messenger(&info, None) }.map_err(|result| {
            DeviceUnavailable::new(format!("validation cannot report ({result})"), INSTALL)
        })?;
        self.validation = Some(Validation { functions, messenger, messages });
        Ok(())
    }

    /// Where the validation layer's messages are collected.
    pub fn messages(&self) -> Arc<Messages> {
        self.validation.as_ref().map_or_else(Arc::default, |v| Arc::clone(&v.messages))
    }

    pub fn physical_devices(&self) -> Result<Vec<vk::PhysicalDevice>, DeviceUnavailable> {
        // SAFETY: the instance is alive.
        let found = unsafe { self.raw.enumerate_physical_devices() };
        let found = found.map_err(|result| {
            DeviceUnavailable::new(format!("no Vulkan driver answers ({result})"), INSTALL)
        })?;
        match found.is_empty() {
            true => Err(DeviceUnavailable::new("there is no Vulkan device", INSTALL)),
            false => Ok(found),
        }
    }

    /// The first family of queues that computes, and how many bits its clock has.
    pub fn compute_family(&self, device: vk::PhysicalDevice) -> Option<(u32, u32)> {
        // SAFETY: the device is this instance's.
        let families = unsafe { self.raw.get_physical_device_queue_family_properties(device) };
        let at = families.iter().position(|family| family.queue_flags.contains(vk::QueueFlags::COMPUTE))?;
        Some((at as u32, families[at].timestamp_valid_bits))
    }

    /// What a device is and lacks.
    pub fn describe(&self, index: usize, device: vk::PhysicalDevice) -> DeviceInfo {
        let mut driver = vk::PhysicalDeviceDriverProperties::default();
        let mut properties = vk::PhysicalDeviceProperties2::default().push_next(&mut driver);
        let mut twelve = vk::PhysicalDeviceVulkan12Features::default();
        let mut features = vk::PhysicalDeviceFeatures2::default().push_next(&mut twelve);
        // SAFETY: the device is this instance's; a structure that an older one does not know stays as it is.
        let memory = unsafe {
            self.raw.get_physical_device_properties2(device, &mut properties);
            self.raw.get_physical_device_features2(device, &mut features);
            self.raw.get_physical_device_memory_properties(device)
        };
        let properties = properties.properties;
        let has_int64 = features.features.shader_int64 == vk::TRUE;
        let needs = [
            (properties.api_version >= vk::API_VERSION_1_2, "Vulkan 1.2"),
            (has_int64, "64-bit integers in shaders (shaderInt64)"),
            (twelve.timeline_semaphore == vk::TRUE, "timeline semaphores"),
            (self.compute_family(device).is_some(), "a compute queue"),
        ];
        let lacking = needs.iter().filter(|(there, _)| !there).map(|(_, what)| (*what).to_owned());
        let heaps = memory.memory_heaps_as_slice().iter();
        let own = heaps.filter(|heap| heap.flags.contains(vk::MemoryHeapFlags::DEVICE_LOCAL));
        let text = |chars: &[std::ffi::c_char]| -> String {
            let bytes: Vec<u8> = chars.iter().take_while(|c| **c != 0).map(|c| *c as u8).collect();
            String::from_utf8_lossy(&bytes).into_owned()
        };
        let version = properties.api_version;
        DeviceInfo {
            index,
            name: text(&properties.device_name),
            kind: match properties.device_type {
                vk::PhysicalDeviceType::DISCRETE_GPU => DeviceKind::Discrete,
                vk::PhysicalDeviceType::INTEGRATED_GPU => DeviceKind::Integrated,
                vk::PhysicalDeviceType::VIRTUAL_GPU => DeviceKind::Virtual,
                vk::PhysicalDeviceType::CPU => DeviceKind::Cpu,
                _ => DeviceKind::Other,
            },
            driver: format!("{} {}", text(&driver.driver_name), text(&driver.driver_info)).trim().to_owned(),
            version: format!(
                "{}.{}.{}",
                vk::api_version_major(version),
                vk::api_version_minor(version),
                vk::api_version_patch(version)
            ),
            memory: own.map(|heap| heap.size).max().unwrap_or(0),
            missing: lacking.chain(too_small(&properties.limits)).collect(),
        }
    }
}

/// Limits of a device that are too small for the kernels, with Vulkan's names for them. Other limits that matter are
/// large enough wherever there is Vulkan.
fn too_small(limits: &vk::PhysicalDeviceLimits) -> impl Iterator<Item = String> {
    let needs = [
        (limits.max_per_stage_descriptor_storage_buffers, BUFFERS, "maxPerStageDescriptorStorageBuffers"),
        (limits.max_descriptor_set_storage_buffers, BUFFERS, "maxDescriptorSetStorageBuffers"),
        (limits.max_per_stage_resources, BUFFERS, "maxPerStageResources"),
        (limits.max_compute_work_group_size[0], WORKGROUP, "maxComputeWorkGroupSize"),
        (limits.max_compute_work_group_invocations, WORKGROUP, "maxComputeWorkGroupInvocations"),
        (limits.max_compute_shared_memory_size, SHARED_BYTES, "maxComputeSharedMemorySize"),
    ];
    let lack = |(has, needed, name): (u32, u32, &str)| {
        (has < needed).then(|| format!("{name} of {needed} (it has {has})"))
    };
    needs.into_iter().filter_map(lack)
}

impl Drop for Instance {
    fn drop(&mut self) {
        // SAFETY: whatever was made from the instance holds a reference to what owns it, so nothing is left.
        unsafe {
            if let Some(validation) = &self.validation {
                validation.functions.destroy_debug_utils_messenger(validation.messenger, None);
            }
            self.raw.destroy_instance(None);
        }
    }
}

// SAFETY: called by the validation layer with the `user_data` of `listen`, a `Messages` that lives as long as the
// messenger, and with a message whose text ends in a zero byte; it does not unwind.
unsafe extern "system" fn keep_message(
    _: vk::DebugUtilsMessageSeverityFlagsEXT,
    _: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    messages: *mut c_void,
) -> vk::Bool32 {
    // SAFETY: as above.
    let (text, messages) = unsafe {
        (CStr::from_ptr((*data).p_message).to_string_lossy().into_owned(), &*messages.cast::<Messages>())
    };
    messages.lock().unwrap_or_else(PoisonError::into_inner).push(text);
    vk::FALSE
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_limit_that_is_too_small_is_named() {
        let mut limits = vk::PhysicalDeviceLimits {
            max_per_stage_descriptor_storage_buffers: 14,
            max_descriptor_set_storage_buffers: 24,
            max_per_stage_resources: 128,
            max_compute_work_group_size: [128, 128, 64],
            max_compute_work_group_invocations: 128,
            max_compute_shared_memory_size: 16384,
            ..Default::default()
        };
        assert_eq!(too_small(&limits).count(), 0);
        limits.max_per_stage_descriptor_storage_buffers = 8;
        limits.max_compute_work_group_size[0] = 32;
        let found: Vec<String> = too_small(&limits).collect();
        assert_eq!(
            found,
            [
                "maxPerStageDescriptorStorageBuffers of 14 (it has 8)",
                "maxComputeWorkGroupSize of 64 (it has 32)"
            ]
        );
        assert_eq!(too_small(&vk::PhysicalDeviceLimits::default()).count(), 6);
    }
}
