//! Disjoint sets of facets, each of which runs with its set or against it.

/// Disjoint sets (Tarjan 1975), with the parity of every element relative to its set. A set is named by its lowest
/// element. 4 bytes an element.
pub(super) struct ParitySets(Vec<u32>);

impl ParitySets {
    /// Of `count` elements, each alone. There may be less than 2^31.
    pub fn new(count: usize) -> ParitySets {
        ParitySets((0..count as u32).map(|element| element << 1).collect())
    }

    /// The set of an element, and whether it runs against it.
    pub fn find(&mut self, element: u32) -> (u32, bool) {
        let (mut at, mut against) = (element, 0);
        loop {
            let up = self.0[at as usize];
            if up >> 1 == at {
                return (at, against == 1);
            }
            // Halves the path.
            let above = self.0[(up >> 1) as usize];
            let next = above ^ (up & 1);
            self.0[at as usize] = next;
            against ^= next & 1;
            at = next >> 1;
        }
    }

    /// Unites the sets of two elements so that they run `opposite` ways, or the same. False if they are of one set
    /// already and it says otherwise.
    pub fn unite(&mut self, a: u32, b: u32, opposite: bool) -> bool {
        let ((a, against_a), (b, against_b)) = (self.find(a), self.find(b));
        let differs = against_a ^ against_b ^ opposite;
        if a == b {
            return !differs;
        }
        self.0[a.max(b) as usize] = a.min(b) << 1 | u32::from(differs);
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parities_follow_from_pairs() {
        let mut sets = ParitySets::new(9);
        assert!(sets.unite(8, 7, true) && sets.unite(7, 5, true) && sets.unite(3, 5, true));
        assert_eq!(sets.find(8), (3, true));
        assert_eq!(sets.find(7), (3, false));
        assert_eq!(sets.find(5), (3, true));
        assert!(sets.unite(8, 5, false) && !sets.unite(8, 5, true) && !sets.unite(7, 5, false));
        assert!(sets.unite(0, 7, true) && sets.unite(1, 2, false));
        assert_eq!((sets.find(8), sets.find(3), sets.find(0)), ((0, false), (0, true), (0, false)));
        assert_eq!((sets.find(2), sets.find(4)), ((1, false), (4, false)));
    }
}
