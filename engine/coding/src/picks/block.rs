//! A block of segments as bytes, written once for both directions.

use super::segment::{PickBead, PickSegment};
use super::wide::WideNumber;
use crate::range::{Bit, Coder};

/// Most segments of a block.
pub const SEGMENTS_MAX: usize = 4096;
/// Largest coordinate and size, in steps: 25 bits.
const STEPS_MAX: i64 = 1 << 25;
/// Largest line.
const LINE_MAX: i64 = 1 << 60;
/// Classes of how far a segment went before.
const SPANS: usize = 26;

/// What is learnt of a block.
struct BlockModel {
    begins: Bit,
    follows: [Bit; 2],
    is_turned: Bit,
    numbers: WideNumber,
    layers: WideNumber,
    kinds: [WideNumber; 2],
    lines: [WideNumber; 3],
    travels: [WideNumber; 3],
    /// By axis, and by how far the segment before the last went along it.
    spans: [Vec<WideNumber>; 3],
    sizes: [WideNumber; 2],
    axes: [WideNumber; 3],
}

impl BlockModel {
    fn new() -> BlockModel {
        let three = || [WideNumber::NEW, WideNumber::NEW, WideNumber::NEW];
        let two = || [WideNumber::NEW, WideNumber::NEW];
        BlockModel {
            begins: Bit::NEW,
            follows: [Bit::NEW; 2],
            is_turned: Bit::NEW,
            numbers: WideNumber::NEW,
            layers: WideNumber::NEW,
            kinds: two(),
            lines: three(),
            travels: three(),
            spans: [0; 3].map(|_| vec![WideNumber::NEW; SPANS]),
            sizes: two(),
            axes: three(),
        }
    }
}

/// Codes `count` segments: those of `wanted`, or of no meaning where a decoder fills them in. `by_segment` says whether lines
/// are those of segments rather than of beads.
pub fn block<C: Coder>(
    coder: &mut C,
    by_segment: bool,
    count: usize,
    wanted: &[PickSegment],
) -> Vec<PickSegment> {
    let mut model = BlockModel::new();
    let mut found: Vec<PickSegment> = Vec::with_capacity(count.min(SEGMENTS_MAX));
    for n in 0..count.min(SEGMENTS_MAX) {
        let last = if n > 0 { found[n - 1] } else { PickSegment::START };
        let before = if n > 1 { found[n - 2] } else { PickSegment::START };
        let value = wanted.get(n).copied().unwrap_or(PickSegment::START);
        let begins = coder.bit(&mut model.begins, value.bead != last.bead);
        let bead =
            if begins { bead(coder, &mut model, by_segment, last.bead, value.bead) } else { last.bead };
        let line = match by_segment {
            true => sum(coder, &mut model.lines[0], last.line as i64, value.line as i64, LINE_MAX) as u64,
            false => 0,
        };
        let (a, b) = ends(coder, &mut model, begins, (&before, &last), &value);
        let width = sum(coder, &mut model.sizes[0], last.width.into(), value.width.into(), STEPS_MAX) as u32;
        let height =
            sum(coder, &mut model.sizes[1], last.height.into(), value.height.into(), STEPS_MAX) as u32;
        let mut axis = last.axis;
        if coder.bit(&mut model.is_turned, value.axis != last.axis) {
            for (a, model) in model.axes.iter_mut().enumerate() {
                let turned = model.signed(coder, i64::from(value.axis[a]) - i64::from(last.axis[a]));
                axis[a] = within(coder, turned.saturating_add(axis[a].into()), -(1 << 14), 1 << 14) as i16;
            }
            if axis == [0; 3] {
                coder.refuse();
                axis = last.axis;
            }
        }
        found.push(PickSegment { a, b, width, height, axis, bead, line });
    }
    found
}

/// A bead that is another than the last one.
fn bead<C: Coder>(
    coder: &mut C,
    model: &mut BlockModel,
    by_segment: bool,
    last: PickBead,
    value: PickBead,
) -> PickBead {
    let most = i64::from(u32::MAX);
    let number = sum(coder, &mut model.numbers, last.number.into(), value.number.into(), most) as u32;
    let layer = sum(coder, &mut model.layers, last.layer.into(), value.layer.into(), most) as u32;
    let feature = sum(coder, &mut model.kinds[0], last.feature.into(), value.feature.into(), most) as u32;
    let source = sum(coder, &mut model.kinds[1], last.source.into(), value.source.into(), most) as u32;
    let mut lines = (0, 0);
    if !by_segment {
        let first = sum(coder, &mut model.lines[1], last.lines.1 as i64, value.lines.0 as i64, LINE_MAX);
        let to = sum(coder, &mut model.lines[2], first, value.lines.1 as i64, LINE_MAX);
        lines = (first as u64, to as u64);
    }
    PickBead { number, layer, feature, source, lines }
}

/// Both ends. The first is where the last segment ended, or is told from there.
fn ends<C: Coder>(
    coder: &mut C,
    model: &mut BlockModel,
    begins: bool,
    (before, last): (&PickSegment, &PickSegment),
    value: &PickSegment,
) -> ([i32; 3], [i32; 3]) {
    let mut a = last.b;
    if !coder.bit(&mut model.follows[usize::from(begins)], value.a == last.b) {
        for (axis, a) in a.iter_mut().enumerate() {
            let (from, to) = (last.b[axis].into(), value.a[axis].into());
            *a = sum(coder, &mut model.travels[axis], from, to, STEPS_MAX) as i32;
        }
    }
    let mut b = a;
    for axis in 0..3 {
        // Lines of infill have like ones two segments before: a connection lies between.
        let span = before.b[axis].abs_diff(before.a[axis]);
        let class = (u32::BITS - span.leading_zeros()) as usize;
        let model = &mut model.spans[axis][class.min(SPANS - 1)];
        b[axis] = sum(coder, model, a[axis].into(), value.b[axis].into(), STEPS_MAX) as i32;
    }
    (a, b)
}

/// Codes a number from 0 to `most` by its difference from another.
fn sum<C: Coder>(coder: &mut C, model: &mut WideNumber, from: i64, value: i64, most: i64) -> i64 {
    let difference = model.signed(coder, value - from);
    within(coder, from.saturating_add(difference), 0, most)
}

fn within<C: Coder>(coder: &mut C, value: i64, least: i64, most: i64) -> i64 {
    if value < least || value > most {
        coder.refuse();
    }
    value.max(least).min(most)
}
