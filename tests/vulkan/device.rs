//! What a device alone must show: exact ties, failures amid a build, little memory, the sum over all triangles.

use crate::backend::{Backend, open, open_staged, options, read, reference, reference_with, silent};
use crate::suite::{deciding, input_of, open_data};
use brickfield_bench_data::pile::{lattice_pile, random_pile};
use brickfield_bench_data::shapes::cuboid;
use brickfield_bench_data::{Mesh, Rng};
use brickfield_engine::Silent;
use brickfield_engine::backend::{
    BatchLeaf, DeviceReport, LeafQueue, NodeQueue, Vulkan, brute_at as brute_on_device,
};
use brickfield_engine::brick::{Brick, ThinLines};
use brickfield_engine::build::BuildOptions;
use brickfield_engine::gpu::{DeviceFailure, DeviceKind, InjectedFailure, Stage};
use brickfield_engine::ingest::{Facet, Input};
use brickfield_engine::lattice::{NodeKey, Octant, RootCube, Triangle};
use brickfield_engine::winding::{Evaluator, TriangleList, brute_at};

/// Vertices on the lattice itself, so that lines run through edges of facets and samples lie on them.
#[test]
#[ignore = "needs a Vulkan device and the validation layer; run with -- --ignored"]
fn exact_ties_are_decided_alike() {
    let backend = Backend::new(Some(open(0)), 1);
    let device = backend.device.as_ref().unwrap();
    let (mut queue, mut here, mut there) = (LeafQueue::default(), Evaluator::default(), Evaluator::default());
    let mut undecided = NodeQueue::default();
    let mut hidden = [0; 2];
    for (seed, level) in (0..24).zip([0u8, 1, 2].into_iter().cycle()) {
        // Cells of the pile as large as some steps of the samples, or as some cells of a brick.
        let step = if seed % 2 == 0 { 1 << 18 } else { 3 << 16 };
        let pile = Mesh::merged(&lattice_pile(seed, 10, step, 60));
        let array: Vec<Triangle> = pile.facets().map(|t: Facet| t.map(|v| v.map(|c| c as i32))).collect();
        let all: Vec<u32> = (0..array.len() as u32).collect();
        let mut nodes = vec![(NodeKey::ROOT, 0)];
        for _ in 0..level {
            nodes = nodes
                .into_iter()
                .flat_map(|(key, corner)| children(&mut here, &array, &all, key, corner))
                .collect();
        }
        let leaves: Vec<BatchLeaf<'_>> = nodes
            .iter()
            .map(|&(key, corner)| BatchLeaf { key, corner, array: &array, indices: &all })
            .collect();
        queue.begin(device);
        undecided.find(device, &leaves);
        for leaf in &leaves {
            let (brick, thin) = queue.next(device, &mut there, &leaves).unwrap();
            let list = TriangleList { array: &array, indices: &all };
            let evaluation = here.evaluate(leaf.key, leaf.corner, list).unwrap();
            let has_hidden_crossings = evaluation.has_hidden_crossings();
            assert_eq!(thin, evaluation.thin(ThinLines::Sixteenth), "{seed}: {}", leaf.key);
            let expected = evaluation.into_leaf().unwrap();
            let found = undecided.take(device, leaf.key).unwrap();
            assert!(brick == expected && found.clone().into_leaf() == expected, "{seed}: {}", leaf.key);
            let is_hidden = found.has_hidden_crossings();
            assert_eq!(is_hidden, has_hidden_crossings, "{seed}: {}", leaf.key);
            hidden[usize::from(has_hidden_crossings)] += 1;
        }
    }
    assert!(hidden.iter().all(|bricks| *bricks > 20), "{hidden:?}");
    assert_eq!(backend.report().unwrap().cpu_bricks, 0);
    silent(&backend);
}

fn evaluate(
    evaluator: &mut Evaluator,
    array: &[Triangle],
    indices: &[u32],
    key: NodeKey,
    corner: i16,
) -> Brick {
    evaluator.evaluate(key, corner, TriangleList { array, indices }).unwrap().into_leaf().unwrap()
}

fn children(
    evaluator: &mut Evaluator,
    array: &[Triangle],
    all: &[u32],
    key: NodeKey,
    corner: i16,
) -> Vec<(NodeKey, i16)> {
    let brick = evaluate(evaluator, array, all, key, corner);
    let child = |octant: Octant| (key.child(octant), brick.sample(octant.offset().map(|o| 16 * o)));
    Octant::all().map(child).collect()
}

/// An edge where the winding number jumps by more than the kernels' 8 bits leaves its brick to the processor. The jumps up
/// and down are at neighbouring edges, which share a word, and lie within the part, so that nothing else is in the way.
#[test]
#[ignore = "needs a Vulkan device and the validation layer; run with -- --ignored"]
fn jumps_beyond_eight_bits_are_the_processors() {
    let backend = Backend::new(Some(open(0)), 2);
    // The box spans 62 of the 64 cells; each place is one edge further in a word than the one before.
    let cell = 2.0 / 62.0;
    let around_a_sample = |n: usize| {
        let at = [-0.95 + 9.0 * cell * n as f64, -0.5, -0.4];
        cuboid(at, at.map(|c| c + cell))
    };
    for (copies, of_processor) in [(127, 0), (128, 1), (256, 1), (300, 1)] {
        let mut pieces = vec![cuboid([-1.0; 3], [1.0; 3])];
        (0..4).for_each(|n| pieces.extend(vec![around_a_sample(n); copies]));
        let pile = input_of(&pieces);
        let (store, summary) = backend.build_with(&pile, 1, &options(1));
        assert!(store == *reference(&pile, 1), "{copies} copies");
        let report = summary.device.unwrap();
        assert_eq!((report.cpu_bricks, report.failure.as_ref()), (of_processor, None), "{copies} copies");
    }
    silent(&backend);
}

fn fault(stage: Stage, after: u32, times: u32, failure: DeviceFailure) -> InjectedFailure {
    InjectedFailure { stage, after, times, failure }
}

/// Builds on a device that fails; the store is as expected, and the report names the failure.
fn build_amid(
    fault: InjectedFailure,
    input: &Input,
    depth: u8,
    options: &BuildOptions,
    expected: &[u8],
) -> (Backend, DeviceReport) {
    let backend = Backend::new(Some(open(0)), 2);
    backend.device.as_ref().unwrap().gpu().inject(fault);
    let (store, summary) = backend.build_with(input, depth, options);
    assert!(store == expected, "{fault:?}");
    let report = summary.device.unwrap();
    assert_eq!(report.failure, Some(fault.failure.to_string()), "{fault:?}");
    silent(&backend);
    (backend, report)
}

/// A build on a device that fails ends with the same store; the report says what happened.
#[test]
#[ignore = "needs a Vulkan device and the validation layer; run with -- --ignored"]
fn failures_end_in_the_same_store() {
    let input = open_data("clover.gcode");
    let expected = reference(&input, 4);
    for (fault, is_retried) in [
        (fault(Stage::Allocate, 0, 1, DeviceFailure::OutOfMemory), true),
        (fault(Stage::Allocate, 1, 1000, DeviceFailure::OutOfMemory), true),
        (fault(Stage::Submit, 5, 1, DeviceFailure::OutOfMemory), true),
        (fault(Stage::Submit, 5, 1000, DeviceFailure::OutOfMemory), true),
        (fault(Stage::Submit, 3, 1, DeviceFailure::Lost), false),
        (fault(Stage::Wait, 4, 1, DeviceFailure::Lost), false),
        (fault(Stage::Wait, 0, 1, DeviceFailure::Timeout), false),
        (fault(Stage::Wait, 2, 3, DeviceFailure::OutOfMemory), true),
    ] {
        let (backend, report) = build_amid(fault, &input, 4, &options(4), &expected);
        assert_eq!(report.retries > 0, is_retried, "{fault:?}: {report:?}");
        assert!(report.cpu_bricks > 0 || fault.times == 1, "{fault:?}: {report:?}");
        assert_eq!(backend.device.as_ref().unwrap().gpu().is_lost(), !is_retried, "{fault:?}");
    }
}

/// On a software driver a long build opens a second device: what both allocate counts together, and if one is lost the
/// other goes on.
#[test]
#[ignore = "needs a Vulkan device and the validation layer; run with -- --ignored"]
fn a_second_device_shares_the_work() {
    // So little memory that there are many batches.
    let memory = 8 << 20;
    let pile = input_of(&random_pile(3, 60));
    let expected = reference(&pile, 4);
    let lost = InjectedFailure { stage: Stage::Submit, after: 150, times: 1, failure: DeviceFailure::Lost };
    for fault in [None, Some(lost)] {
        let backend = Backend::new(Some(open(memory)), 2);
        let gpu = backend.device.as_ref().unwrap().gpu();
        fault.into_iter().for_each(|fault| gpu.inject(fault));
        let (store, summary) = backend.build_with(&pile, 4, &options(4));
        let report = summary.device.unwrap();
        assert!(store == *expected && report.peak_bytes <= memory, "{report:?}");
        assert_eq!(gpu.allocated().0, 0, "{fault:?}");
        // Hardware has no second device, so that all batches end with the one that is lost.
        let has_second = gpu.info().kind == DeviceKind::Cpu;
        assert!(report.batches > 150 || (fault.is_some() && !has_second), "{report:?}");
        if has_second {
            let are_lost = [gpu.is_lost(), gpu.second().unwrap().is_lost()];
            assert_eq!(
                are_lost.iter().filter(|is_lost| **is_lost).count(),
                fault.iter().count(),
                "{report:?}"
            );
        }
        assert!(report.cpu_bricks > 0 || fault.is_none(), "{report:?}");
        silent(&backend);
    }
}

/// So does one whose nodes decide for themselves.
#[test]
#[ignore = "needs a Vulkan device and the validation layer; run with -- --ignored"]
fn failures_amid_decisions_end_in_the_same_store() {
    let input = open_data("stl/clover_beads.stl");
    let options = &deciding(4)[2];
    let expected = reference_with(&input, 4, options);
    for (fault, is_done_for) in [
        (fault(Stage::Allocate, 0, 1, DeviceFailure::OutOfMemory), false),
        (fault(Stage::Allocate, 0, 1000, DeviceFailure::OutOfMemory), true),
        (fault(Stage::Submit, 3, 1, DeviceFailure::OutOfMemory), false),
        (fault(Stage::Submit, 1, 1, DeviceFailure::Lost), true),
        (fault(Stage::Wait, 4, 1, DeviceFailure::Lost), true),
        (fault(Stage::Wait, 2, 1, DeviceFailure::Timeout), true),
    ] {
        let (_, report) = build_amid(fault, &input, 4, options, &expected);
        assert_eq!(report.bricks < report.cpu_bricks, is_done_for, "{fault:?}: {report:?}");
    }
}

/// So does one of an open soup, whether the clusters fail to get there or the samples to come back.
#[test]
#[ignore = "needs a Vulkan device and the validation layer; run with -- --ignored"]
fn failures_amid_open_soups_end_in_the_same_store() {
    let input = open_data("stl/open_box_no_lid.stl");
    let expected = reference(&input, 2);
    for fault in [
        fault(Stage::Allocate, 0, 1, DeviceFailure::OutOfMemory),
        fault(Stage::Allocate, 1, 1000, DeviceFailure::OutOfMemory),
        fault(Stage::Submit, 1, 1, DeviceFailure::Lost),
        fault(Stage::Submit, 3, 1000, DeviceFailure::OutOfMemory),
        fault(Stage::Wait, 1, 1, DeviceFailure::Timeout),
        fault(Stage::Wait, 3, 1, DeviceFailure::Lost),
    ] {
        let (_, report) = build_amid(fault, &input, 2, &options(2), &expected);
        assert!(report.cpu_bricks > 0, "{fault:?}: {report:?}");
    }
}

/// With room for no brick, or for one at a time, and never more than is allowed.
#[test]
#[ignore = "needs a Vulkan device and the validation layer; run with -- --ignored"]
fn little_memory_is_enough_for_open_soups() {
    let input = open_data("stl/open_box_no_lid.stl");
    let expected = reference(&input, 2);
    // Copies to and from a device take as much again.
    for (memory, is_used, open) in [
        (1, false, open as fn(u64) -> Vulkan),
        (2 << 20, false, open),
        (32 << 20, true, open),
        (2 << 20, false, open_staged),
        (32 << 20, true, open_staged),
    ] {
        let backend = Backend::new(Some(open(memory)), 2);
        let (store, summary) = backend.build_with(&input, 2, &options(2));
        let report = summary.device.unwrap();
        assert!(store == *expected, "{memory} bytes: {report:?}");
        assert!(report.peak_bytes <= memory && (report.bricks > 0) == is_used, "{memory}: {report:?}");
        silent(&backend);
    }
}

/// Whatever may be allocated, no more is; with room for no brick, or for a few, or for fewer edges than some have.
#[test]
#[ignore = "needs a Vulkan device and the validation layer; run with -- --ignored"]
fn little_memory_is_enough_and_never_exceeded() {
    let pile = input_of(&random_pile(3, 60));
    let expected = reference(&pile, 3);
    let ways: [fn(u64) -> Vulkan; 2] = [open, open_staged];
    let memories = [1, 1 << 20, 8 << 20, 12_345_678, 64 << 20];
    for (memory, open) in memories.into_iter().flat_map(|memory| ways.map(|open| (memory, open))) {
        let backend = Backend::new(Some(open(memory)), 2);
        let (store, summary) = backend.build_with(&pile, 3, &options(3));
        assert!(store == *expected, "{memory} bytes: {:?}", summary.device);
        let report = summary.device.unwrap();
        assert!(report.peak_bytes <= memory, "{report:?}");
        assert_eq!(
            (report.bricks > 0, report.peak_bytes > 0),
            (memory >= 8 << 20, memory >= 8 << 20),
            "{report:?}"
        );
        silent(&backend);
    }
}

/// Where the device's memory is the host's there is none for copies.
#[test]
#[ignore = "needs a Vulkan device and the validation layer; run with -- --ignored"]
fn memory_in_common_is_used_in_place() {
    let pile = input_of(&random_pile(3, 60));
    let [in_place, staged] = [open(0), open_staged(0)].map(|device| {
        let kind = device.gpu().info().kind;
        let backend = Backend::new(Some(device), 2);
        let report = backend.build_with(&pile, 3, &options(3)).1.device.unwrap();
        assert!(report.bricks > 0 && report.peak_bytes > 0, "{report:?}");
        silent(&backend);
        (kind, report.peak_bytes)
    });
    let is_hosts = matches!(in_place.0, DeviceKind::Cpu | DeviceKind::Integrated);
    assert_eq!(in_place.1 < staged.1, is_hosts, "{in_place:?} {staged:?}");
}

/// What a device has left when it is closed.
struct Left {
    /// Bytes that are still allocated.
    bytes: u64,
    /// What the validation layer has to say, to the very end: it names every object that was not given back.
    messages: Vec<String>,
}

/// Builds on a device, with a fault if there is one, and closes it.
fn left_by(builds: usize, faults: &[InjectedFailure]) -> Left {
    let pile = input_of(&random_pile(4, 12));
    let device = open(0);
    let gpu = device.gpu().clone();
    faults.iter().for_each(|fault| gpu.inject(*fault));
    let backend = Backend::new(Some(device), 2);
    for _ in 0..builds {
        backend.build_with(&pile, 3, &options(3));
        assert!(gpu.allocated().1 <= gpu.memory());
    }
    let (bytes, messages) = (gpu.allocated().0, gpu.messages());
    drop((backend, gpu));
    assert_eq!(std::sync::Arc::strong_count(&messages), 1, "the device is still open");
    Left { bytes, messages: read(&messages) }
}

/// Builds give back all memory, and the device is left without an object: the validation layer tells of each.
#[test]
#[ignore = "needs a Vulkan device and the validation layer; run with -- --ignored"]
fn nothing_is_left_behind() {
    let fault = |stage, after, failure| InjectedFailure { stage, after, times: 1, failure };
    // A build that fails on its way gives all back, too.
    let fails = [
        fault(Stage::Allocate, 2, DeviceFailure::OutOfMemory),
        fault(Stage::Submit, 4, DeviceFailure::OutOfMemory),
        fault(Stage::Submit, 9, DeviceFailure::Lost),
    ];
    for (builds, faults) in [(12, &[][..]), (2, &fails)] {
        let left = left_by(builds, faults);
        assert_eq!((left.bytes, left.messages), (0, Vec::new()), "{faults:?}");
    }
}

/// [`nothing_is_left_behind`] can fail: one thing of each kind that is not given back is found.
#[test]
#[ignore = "needs a Vulkan device and the validation layer; run with -- --ignored"]
fn what_is_left_behind_is_found() {
    for (stage, kept, bytes_tell) in
        [(Stage::FreeMemory, "VkDeviceMemory", true), (Stage::FreeCommands, "VkCommandPool", false)]
    {
        let left =
            left_by(2, &[InjectedFailure { stage, after: 1, times: 1, failure: DeviceFailure::OutOfMemory }]);
        assert_eq!(left.bytes > 0, bytes_tell, "{kept}");
        assert!(left.messages.iter().any(|message| message.contains(kept)), "{kept}: {:?}", left.messages);
    }
}

/// The sum of solid angles in single precision against the one in double precision.
#[test]
#[ignore = "needs a Vulkan device and the validation layer; run with -- --ignored"]
fn the_sum_over_all_triangles_is_close() {
    let backend = Backend::new(Some(open(0)), 1);
    let soup: Vec<Facet> = Mesh::merged(&random_pile(1, 30)).facets().collect();
    let root = RootCube::around([-4.0; 3], [4.0; 3]).unwrap();
    let mut rng = Rng::new(7);
    let mut points: Vec<[f64; 3]> =
        (0..5000).map(|_| std::array::from_fn(|_| rng.range(-4.0, 4.0))).collect();
    points.extend([[1e3, 0.0, 0.0], [0.0, 1e300, 0.0]]);
    let values = brute_on_device(backend.device.as_ref().unwrap(), &[&soup], root, &points, &Silent).unwrap();
    let expected = brute_at(&[&soup], root, &points, &Silent).unwrap();
    let mut errors: Vec<f64> = values.iter().zip(&expected).map(|(a, b)| (a - b).abs()).collect();
    errors.sort_by(f64::total_cmp);
    // A point close to a triangle may be on its other side in single precision.
    assert!(errors[errors.len() / 2] < 1e-5 && errors[errors.len() - 10] < 1e-3, "{:?}", &errors[4990..]);
    silent(&backend);
}
