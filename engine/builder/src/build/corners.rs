//! Samples at the corners of bricks some levels below a node.

/// The corner sample of the bottom node with this Morton number.
pub(super) fn corner_at(corners: &[i64], stride: u8, number: usize) -> i16 {
    let at: [usize; 3] = std::array::from_fn(|a| {
        (0..usize::from(stride)).fold(0, |p, bit| p | (number >> (3 * bit + a) & 1) << bit)
    });
    let across = 1usize << stride;
    let w = corners.get((at[2] * across + at[1]) * across + at[0]).copied().unwrap_or(0);
    // Where this does not fit, the evaluation of the bricks around fails with the reason.
    w.clamp(i64::from(i16::MIN), i64::from(i16::MAX)) as i16
}
