//! What a device computes is believed only as far as it is checked: wrong answers are planted, found, told, and made good.

use crate::backend::{Backend, open, open_staged, options, reference, reference_with, silent};
use crate::suite::{Stop, deciding, less, open_data};
use brickfield_engine::backend::{DeviceCheck, DeviceReport, Vulkan};
use brickfield_engine::build::BuildOptions;
use brickfield_engine::gpu::{DeviceFailure, InjectedFailure, Stage, WrongAnswer};
use brickfield_engine::ingest::Input;
use brickfield_engine::{Error, Silent};

fn on(device: Vulkan, check: DeviceCheck, wrong: Option<WrongAnswer>) -> Backend {
    wrong.into_iter().for_each(|wrong| device.gpu().spoil(wrong));
    Backend::new(Some(device.with_check(check)), 2)
}

/// Holds a store that is built on a device with wrong answers against the processor's, and the report against the device.
fn found_in(backend: &Backend, input: &Input, depth: u8, options: &BuildOptions) -> DeviceReport {
    let expected = reference_with(input, depth, options);
    let (store, summary) = backend.build_with(input, depth, options);
    let report = summary.device.unwrap();
    assert!(store == *expected, "{}: {report:?}", input.path().display());
    let info = backend.device.as_ref().unwrap().gpu().info();
    let wrong = report.wrong.as_deref().expect("the wrong brick is told");
    assert!(wrong.contains(&info.name) && wrong.contains(&info.driver) && !wrong.contains('\n'), "{wrong}");
    silent(backend);
    report
}

/// Inputs whose bricks come from each set of kernels, closed ones to this depth.
fn of_each_kernel(depth: u8) -> [(Input, u8, BuildOptions); 3] {
    let holed = less("stl/spot40_model.stl", 7);
    [
        (open_data("stl/clover_beads.stl"), depth, options(depth)),
        (open_data("stl/clover_beads.stl"), depth, deciding(depth)[2].clone()),
        (holed, 1, options(1)),
    ]
}

#[test]
#[ignore = "needs a Vulkan device and the validation layer; run with -- --ignored"]
fn a_driver_that_returns_zeros_is_found() {
    for (input, depth, options) in of_each_kernel(2) {
        for open in [open, open_staged] {
            let backend = on(open(0), DeviceCheck::Some, Some(WrongAnswer::Zeros));
            let report = found_in(&backend, &input, depth, &options);
            assert!((1..20).contains(&report.checked), "{report:?}");
        }
    }
}

/// Far into a build, in one brick alone: if all are checked.
#[test]
#[ignore = "needs a Vulkan device and the validation layer; run with -- --ignored"]
fn one_wrong_sample_is_found_if_all_bricks_are_checked() {
    for (input, depth, options) in of_each_kernel(3) {
        for after in [0, 3] {
            let wrong = WrongAnswer::OneSample { after };
            found_in(&on(open(0), DeviceCheck::All, Some(wrong)), &input, depth, &options);
        }
    }
}

/// Without a check it is written, unless the brick contradicts itself: the tests above can fail.
#[test]
#[ignore = "needs a Vulkan device and the validation layer; run with -- --ignored"]
fn without_a_check_wrong_samples_are_written() {
    let mut written = 0;
    for (input, depth, options) in of_each_kernel(3) {
        let expected = reference_with(&input, depth, &options);
        for after in 0..4 {
            let backend = on(open(0), DeviceCheck::None, Some(WrongAnswer::OneSample { after }));
            let (store, summary) = backend.build_with(&input, depth, &options);
            let report = summary.device.unwrap();
            assert_eq!((store == *expected, report.checked), (report.wrong.is_some(), 0), "{report:?}");
            written += u32::from(report.wrong.is_none());
        }
    }
    assert!(written > 0);
}

/// What an earlier run has made durable goes, too: nobody knows whether it is right.
#[test]
#[ignore = "needs a Vulkan device and the validation layer; run with -- --ignored"]
fn what_was_committed_before_is_given_up() {
    let input = open_data("clover.gcode");
    let expected = reference(&input, 4);
    let directory = tempfile::tempdir().unwrap();
    let out = directory.path().join("part.brf");
    let mut options = options(4);
    options.keeping.pace = std::time::Duration::ZERO;
    let first = on(open(0), DeviceCheck::None, None);
    // Which job is done first depends on threads: early on there may be nothing to keep yet.
    let is_kept = |steps| {
        let stopped = first.build_at(&input, &out, &options, &Stop::after(steps)).unwrap_err();
        matches!(stopped, Error::Suspended { nodes: 1.., .. })
    };
    assert!((3..60).any(is_kept));
    let second = on(open(0), DeviceCheck::Some, Some(WrongAnswer::Zeros));
    let summary = second.build_at(&input, &out, &options, &Silent).unwrap();
    assert!(summary.device.unwrap().wrong.is_some());
    assert!(std::fs::read(&out).unwrap() == *expected);
    let names: Vec<_> =
        std::fs::read_dir(directory.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert_eq!(names, ["part.brf"]);
}

/// A wrong brick that an unchecked run has made durable goes with all others of the device, once that is caught.
#[test]
#[ignore = "needs a Vulkan device and the validation layer; run with -- --ignored"]
fn a_wrong_brick_that_was_committed_does_not_stay() {
    let input = open_data("clover.gcode");
    let expected = reference(&input, 4);
    let mut options = options(4);
    options.keeping.pace = std::time::Duration::ZERO;
    let processor = Backend::new(None, 2);
    // Some planted samples contradict their brick and are caught without a check; early on nothing is committed. Which bricks
    // are committed when a build is stopped depends on threads, so several stops are tried.
    let is_replaced = |(stop, after): (u64, u32)| {
        let directory = tempfile::tempdir().unwrap();
        let out = directory.path().join("part.brf");
        let first = on(open(0), DeviceCheck::None, Some(WrongAnswer::OneSample { after }));
        let stopped = first.build_at(&input, &out, &options, &Stop::after(stop));
        if !matches!(stopped, Err(Error::Suspended { nodes: 1.., .. })) {
            return false;
        }
        // Gone on with by the processor, which believes what stands there, a copy shows whether it is wrong.
        let copies = tempfile::tempdir().unwrap();
        for entry in std::fs::read_dir(directory.path()).unwrap() {
            let entry = entry.unwrap();
            std::fs::copy(entry.path(), copies.path().join(entry.file_name())).unwrap();
        }
        let copy = copies.path().join("part.brf");
        processor.build_at(&input, &copy, &options, &Silent).unwrap();
        if std::fs::read(&copy).unwrap() == *expected {
            return false;
        }
        let second = on(open(0), DeviceCheck::Some, Some(WrongAnswer::Zeros));
        let summary = second.build_at(&input, &out, &options, &Silent).unwrap();
        assert!(summary.device.unwrap().wrong.is_some());
        assert!(std::fs::read(&out).unwrap() == *expected);
        true
    };
    let mut tries =
        [40, 80, 20, 60, 100].into_iter().flat_map(|stop| (0..12).map(move |after| (stop, after)));
    assert!(tries.any(is_replaced), "no run has committed the wrong brick");
}

/// The wait for it is a real one, of the driver's; only patience is shorter.
#[test]
#[ignore = "needs a Vulkan device and the validation layer; run with -- --ignored"]
fn a_driver_that_hangs_is_given_up() {
    // Enough batches for a fourth wait.
    for (input, depth, options) in of_each_kernel(3) {
        for after in [0, 3] {
            let device = open(0);
            device.gpu().inject(InjectedFailure {
                stage: Stage::Stall,
                after,
                times: 1,
                failure: DeviceFailure::Timeout,
            });
            let backend = on(device, DeviceCheck::Some, None);
            let expected = reference_with(&input, depth, &options);
            let (store, summary) = backend.build_with(&input, depth, &options);
            let report = summary.device.unwrap();
            assert!(store == *expected, "{report:?}");
            assert_eq!(report.failure, Some(DeviceFailure::Timeout.to_string()));
            assert!(report.cpu_bricks > 0 && report.wrong.is_none(), "{report:?}");
        }
    }
}

/// A device that is right is checked as far as asked for, and goes on.
#[test]
#[ignore = "needs a Vulkan device and the validation layer; run with -- --ignored"]
fn as_many_bricks_are_checked_as_asked_for() {
    for (input, depth, options) in of_each_kernel(2) {
        for check in [DeviceCheck::All, DeviceCheck::Some, DeviceCheck::None] {
            let backend = on(open(0), check, None);
            let report = backend.build_with(&input, depth, &options).1.device.unwrap();
            assert_eq!((report.wrong, report.failure), (None, None));
            let most = match check {
                DeviceCheck::All => report.bricks..=report.bricks,
                DeviceCheck::Some => 1..=report.bricks / 8 + 4,
                DeviceCheck::None => 0..=0,
            };
            assert!(most.contains(&report.checked), "{check:?}: {} of {}", report.checked, report.bricks);
        }
    }
}
