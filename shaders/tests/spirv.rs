//! The committed SPIR-V is what naga makes of the WGSL sources, and the structures and buffers that they declare are
//! those of the host.
//!
//! After a change of a shader or of `src/layout.rs`: `BRICKFIELD_WRITE_SPIRV=1 cargo test -p brickfield-shaders`.

use brickfield_shaders as layout;
use naga::back::spv;
use naga::valid::{Capabilities, ValidationFlags, Validator};
use std::path::Path;

/// Modules: name, sources in order, buffers by binding.
const MODULES: [(&str, &[&str], &[&str]); 7] = [
    ("scan", &["brick", "normal", "crossing", "scan"], &layout::BRICK_BUFFERS),
    ("evaluate", &["brick", "evaluate"], &layout::BRICK_BUFFERS),
    ("hermite", &["brick", "normal", "crossing", "hermite"], &layout::BRICK_BUFFERS),
    ("brute", &["brute"], &layout::BRUTE_BUFFERS),
    ("open", &["row", "atan", "angle", "moments", "local", "cells"], &layout::SUM_BUFFERS),
    ("rays", &["camera", "field", "stops", "light", "trace", "frame"], &layout::RAY_BUFFERS),
    ("raster", &["raster"], &layout::SPLAT_BUFFERS),
];

/// Modules whose arithmetic is as written: bounds on its errors hold, which they would not if the driver might move
/// operations around or join them.
const AS_WRITTEN: [&str; 1] = ["open"];

/// A module's words: the constants of the host in front of its sources, compiled.
fn module(name: &str, sources: &[&str], buffers: &[&str]) -> Vec<u32> {
    let constants = layout::CONSTANTS.iter().map(|(name, value)| format!("const {name}: u32 = {value}u;\n"));
    let mut text: String = constants.collect();
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    for source in sources {
        let path = folder.join(format!("{source}.wgsl"));
        text += &std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    }
    let words = compile(name, &text, buffers);
    if AS_WRITTEN.contains(&name) { without_contraction(&words) } else { words }
}

#[test]
fn committed_modules_are_those_of_the_sources() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("spirv");
    let writes = std::env::var_os("BRICKFIELD_WRITE_SPIRV").is_some();
    for (name, sources, buffers) in MODULES {
        let bytes: Vec<u8> =
            module(name, sources, buffers).iter().flat_map(|word| word.to_le_bytes()).collect();
        let path = folder.join(format!("{name}.spv"));
        if writes {
            std::fs::write(&path, &bytes).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        }
        let committed = std::fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        assert!(
            committed == bytes,
            "{} is not of its sources: run BRICKFIELD_WRITE_SPIRV=1 cargo test -p brickfield-shaders",
            path.display()
        );
    }
}

fn compile(name: &str, text: &str, buffers: &[&str]) -> Vec<u32> {
    let module = naga::front::wgsl::parse_str(text)
        .unwrap_or_else(|error| panic!("{}", error.emit_to_string_with_path(text, &format!("{name}.wgsl"))));
    let info = Validator::new(ValidationFlags::all(), Capabilities::SHADER_INT64)
        .validate(&module)
        .unwrap_or_else(|error| panic!("{}", error.emit_to_string_with_path(text, &format!("{name}.wgsl"))));
    check_structures(name, &module);
    check_buffers(name, &module, buffers);
    let options = spv::Options {
        lang_version: (1, 3),
        flags: spv::WriterFlags::empty(),
        zero_initialize_workgroup_memory: spv::ZeroInitializeWorkgroupMemoryMode::None,
        force_loop_bounding: false,
        use_storage_input_output_16: false,
        emit_int_div_checks: false,
        ..spv::Options::default()
    };
    spv::write_vec(&module, &info, &options, None).expect("a valid module can be written")
}

/// The module with the decoration `NoContraction` on all arithmetic of floats. By Vulkan's rules a driver may rearrange
/// what does not have it, and naga never sets it.
fn without_contraction(words: &[u32]) -> Vec<u32> {
    /// Words before the first instruction.
    const HEADER: usize = 5;
    const OP_DECORATE: u32 = 71;
    const NO_CONTRACTION: u32 = 42;
    // OpTypeVoid and all other types, before which decorations stand.
    const TYPES: std::ops::RangeInclusive<u32> = 19..=39;
    // OpFNegate, OpFAdd, OpFSub, OpFMul, OpFDiv, OpFRem, OpFMod, OpVectorTimesScalar, OpDot.
    const ARITHMETIC: [u32; 9] = [127, 129, 131, 133, 136, 140, 141, 142, 148];
    let mut decorations = Vec::new();
    let mut types_at = None;
    let mut at = HEADER;
    while let Some(&first) = words.get(at) {
        let (length, code) = ((first >> 16) as usize, first & 0xffff);
        if TYPES.contains(&code) {
            types_at.get_or_insert(at);
        }
        if ARITHMETIC.contains(&code) {
            // The type of the result comes first, then its number.
            decorations.extend([3 << 16 | OP_DECORATE, words[at + 2], NO_CONTRACTION]);
        }
        at += length;
    }
    let types_at = types_at.expect("a module has types");
    assert!(!decorations.is_empty(), "nothing to decorate");
    [&words[..types_at], &decorations, &words[types_at..]].concat()
}

/// A structure that lies in a buffer, or an array of it does, is the host's: the same members at the same offsets.
fn check_structures(name: &str, module: &naga::Module) {
    for (_, global) in module.global_variables.iter().filter(|(_, global)| global.binding.is_some()) {
        let mut of_buffer = &module.types[global.ty];
        if let naga::TypeInner::Array { base, .. } = &of_buffer.inner {
            of_buffer = &module.types[*base];
        }
        let naga::TypeInner::Struct { members, span } = &of_buffer.inner else { continue };
        let struct_name = of_buffer.name.as_deref().unwrap_or_default();
        let host = layout::STRUCTURES.iter().find(|(host, ..)| *host == struct_name);
        let (_, size, host) = host.unwrap_or_else(|| panic!("{name}.wgsl: {struct_name} is not the host's"));
        let of_shader: Vec<(&str, usize)> = members
            .iter()
            .map(|member| (member.name.as_deref().unwrap_or_default(), member.offset as usize))
            .collect();
        assert_eq!((of_shader.as_slice(), *span as usize), (*host, *size), "{name}.wgsl: {struct_name}");
    }
}

/// Every buffer has the place that the host gives it.
fn check_buffers(name: &str, module: &naga::Module, buffers: &[&str]) {
    for (_, global) in module.global_variables.iter() {
        let Some(place) = &global.binding else { continue };
        let global = global.name.as_deref().unwrap_or_default();
        let known = place.group == 0 && buffers.get(place.binding as usize) == Some(&global);
        assert!(known, "{name}.wgsl: {global} is not at binding {} of the host", place.binding);
    }
}
