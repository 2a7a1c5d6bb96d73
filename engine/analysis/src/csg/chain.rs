//! A chain of Booleans, left to right, and what is known of it before any brick is read.

/// How an operand joins those before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Operation {
    /// What is in either.
    Plus,
    /// What is in those before and not in it.
    Minus,
    /// What is in both.
    And,
}

impl Operation {
    /// As in `--minus`.
    pub fn name(self) -> &'static str {
        match self {
            Operation::Plus => "plus",
            Operation::Minus => "minus",
            Operation::And => "and",
        }
    }

    /// What both make of samples that are inside or not.
    #[inline]
    pub(super) fn of(self, before: u64, operand: u64) -> u64 {
        match self {
            Operation::Plus => before | operand,
            Operation::Minus => before & !operand,
            Operation::And => before & operand,
        }
    }
}

/// What is known of an operand, or of those up to one, within a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum OperandState {
    /// Inside everywhere, or nowhere.
    All {
        inside: bool,
        /// Whether nothing can hide between samples.
        certain: bool,
    },
    /// Its boundary may pass.
    Mixed,
}

/// What the chain is within a node, and which operands decide it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Decision {
    pub known: OperandState,
    /// The operands whose boundary may be the result's.
    pub mixed: Vec<usize>,
}

/// Decides a chain of operands, each with the operation before it; that of the first does not count.
pub(super) fn decide(operations: &[Operation], operands: &[OperandState]) -> Decision {
    let mut mixed = Vec::new();
    let mut before = OperandState::All { inside: false, certain: true };
    for (number, (&operation, &operand)) in operations.iter().zip(operands).enumerate() {
        let operation = if number == 0 { Operation::Plus } else { operation };
        let turned = match (operation, operand) {
            (Operation::Minus, OperandState::All { inside, certain }) => {
                OperandState::All { inside: !inside, certain }
            }
            _ => operand,
        };
        // In a sum what is inside decides, in the others what is outside.
        let decides = operation == Operation::Plus;
        let absorbs =
            |known: OperandState| matches!(known, OperandState::All { inside, .. } if inside == decides);
        let certain = |known: OperandState| matches!(known, OperandState::All { certain: true, .. });
        before = match (absorbs(before), absorbs(turned)) {
            (false, false) => {
                if turned == OperandState::Mixed {
                    mixed.push(number);
                }
                match (before, turned) {
                    (OperandState::All { .. }, OperandState::All { .. }) => {
                        OperandState::All { inside: !decides, certain: certain(before) && certain(turned) }
                    }
                    _ => OperandState::Mixed,
                }
            }
            (one, other) => {
                if other {
                    mixed.clear();
                }
                let certain = (one && certain(before)) || (other && certain(turned));
                OperandState::All { inside: decides, certain }
            }
        };
    }
    Decision { known: before, mixed }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// All chains of three operands: what is decided holds for all that the undecided ones may be, and what is not decided
    /// depends on each of those named.
    #[test]
    fn decisions_hold_whatever_is_not_known() {
        let all = |inside| OperandState::All { inside, certain: true };
        let kinds = [all(false), all(true), OperandState::Mixed];
        let operations = [Operation::Plus, Operation::Minus, Operation::And];
        let value = |ops: &[Operation], bits: [bool; 3]| {
            (1..3).fold(bits[0], |acc, n| ops[n].of(u64::from(acc), u64::from(bits[n])) & 1 == 1)
        };
        for case in 0..243usize {
            let digit = |n: u32| case / 3usize.pow(n) % 3;
            let ops = [Operation::Plus, operations[digit(0)], operations[digit(1)]];
            let operands = [kinds[digit(2)], kinds[digit(3)], kinds[digit(4)]];
            let decision = decide(&ops, &operands);
            let may_be = |n: usize, inside: bool| match operands[n] {
                OperandState::All { inside: is, .. } => is == inside,
                OperandState::Mixed => true,
            };
            let combinations = (0..8usize).map(|bits| [0, 1, 2].map(|n| bits >> n & 1 == 1));
            let possible: Vec<[bool; 3]> =
                combinations.filter(|bits| (0..3).all(|n| may_be(n, bits[n]))).collect();
            let values: Vec<bool> = possible.iter().map(|&bits| value(&ops, bits)).collect();
            let is_same = values.iter().all(|v| *v == values[0]);
            assert_eq!(
                decision.known,
                if is_same { all(values[0]) } else { OperandState::Mixed },
                "{operands:?}"
            );
            let depends = |n: usize| {
                possible.iter().any(|&bits| {
                    let mut other = bits;
                    other[n] = !bits[n];
                    operands[n] == OperandState::Mixed && value(&ops, bits) != value(&ops, other)
                })
            };
            let expected: Vec<usize> = (0..3).filter(|&n| !is_same && depends(n)).collect();
            assert_eq!(decision.mixed, expected, "{ops:?} {operands:?}");
        }
    }

    #[test]
    fn what_may_hide_makes_a_decision_uncertain() {
        let all = |inside, certain| OperandState::All { inside, certain };
        let minus = [Operation::Plus, Operation::Minus];
        assert_eq!(decide(&minus, &[all(true, false), all(false, true)]).known, all(true, false));
        assert_eq!(decide(&minus, &[all(true, false), all(true, true)]).known, all(false, true));
        assert_eq!(decide(&minus, &[OperandState::Mixed, all(true, false)]).known, all(false, false));
    }
}
