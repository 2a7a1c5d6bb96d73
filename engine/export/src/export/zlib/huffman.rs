//! Huffman codes of bounded length, from counts and from lengths (RFC 1951, 3.2.2).

/// Bits of the longest code.
const BITS_MAX: usize = 15;

/// Lengths of the codes of symbols that are used `counts` times, at most `longest`; 0 of those that are not used. One symbol
/// alone has a code of one bit. Moffat and Katajainen 1995, "In-Place Calculation of Minimum-Redundancy Codes".
pub(super) fn lengths<const N: usize>(counts: &[u32; N], longest: usize) -> [u8; N] {
    let mut used = Vec::with_capacity(N);
    used.extend(counts.iter().enumerate().filter(|(_, count)| **count > 0).map(|(n, &count)| (count, n)));
    let mut lengths = [0; N];
    match used[..] {
        [] => return lengths,
        [(_, only)] => {
            lengths[only] = 1;
            return lengths;
        }
        _ => {}
    }
    used.sort_unstable();
    let mut depths = used.iter().map(|(count, _)| *count as usize).collect::<Vec<_>>();
    depths_of(&mut depths);
    // How many codes have a length; too long ones are cut, which leaves too many.
    let mut of_length = [0u32; BITS_MAX + 1];
    depths.iter().for_each(|&depth| of_length[depth.min(longest)] += 1);
    let space = |of_length: &[u32]| (1..=longest).map(|n| of_length[n] << (longest - n)).sum::<u32>();
    let mut over = space(&of_length).saturating_sub(1 << longest);
    while over > 0 {
        // A shorter code becomes longer by a bit and takes one of the longest to its side.
        let shorter = (1..longest).rev().find(|&n| of_length[n] > 0).unwrap_or(1);
        of_length[longest] -= 1;
        of_length[shorter] -= 1;
        of_length[shorter + 1] += 2;
        over -= 1;
    }
    // The rarest have the longest.
    let mut order = used.iter().map(|(_, symbol)| *symbol);
    for length in (1..=longest).rev() {
        order.by_ref().take(of_length[length] as usize).for_each(|symbol| lengths[symbol] = length as u8);
    }
    lengths
}

/// Replaces counts, in ascending order, by the depths of their leaves in Huffman's tree.
fn depths_of(a: &mut [usize]) {
    let n = a.len();
    // Weights of inner nodes, then their parents.
    a[0] += a[1];
    let (mut root, mut leaf) = (0, 2);
    for next in 1..n - 1 {
        let mut sum = 0;
        for _ in 0..2 {
            if leaf >= n || (root < next && a[root] < a[leaf]) {
                sum += a[root];
                a[root] = next;
                root += 1;
            } else {
                sum += a[leaf];
                leaf += 1;
            }
        }
        a[next] = sum;
    }
    // Depths of inner nodes.
    a[n - 2] = 0;
    for next in (0..n - 2).rev() {
        a[next] = a[a[next]] + 1;
    }
    // Depths of leaves.
    let (mut free, mut depth, mut root, mut next) = (1usize, 0, n as isize - 2, n as isize - 1);
    while free > 0 {
        let mut inner = 0;
        while root >= 0 && a[root as usize] == depth {
            inner += 1;
            root -= 1;
        }
        while free > inner {
            a[next as usize] = depth;
            next -= 1;
            free -= 1;
        }
        (free, depth) = (2 * inner, depth + 1);
    }
}

/// Codes of symbols, their first bit lowest.
pub(super) struct Code<const N: usize>([(u16, u8); N]);

impl<const N: usize> Code<N> {
    /// The codes of lengths.
    pub(super) fn new(lengths: &[u8; N]) -> Code<N> {
        let mut next = [0u16; BITS_MAX + 2];
        lengths.iter().filter(|length| **length > 0).for_each(|&length| next[usize::from(length) + 1] += 1);
        for length in 1..next.len() {
            next[length] = (next[length] + next[length - 1]) << 1;
        }
        Code(lengths.map(|length| {
            if length == 0 {
                return (0, 0);
            }
            let code = &mut next[usize::from(length)];
            let bits = code.reverse_bits() >> (16 - length);
            *code = code.wrapping_add(1);
            (bits, length)
        }))
    }

    /// Bits of a symbol and how many.
    #[inline]
    pub(super) fn of(&self, symbol: usize) -> (u32, u32) {
        let (bits, length) = self.0[symbol];
        (u32::from(bits), u32::from(length))
    }
}
