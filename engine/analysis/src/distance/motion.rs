//! Rigid motions.

use crate::lattice::{dot, minus};

/// A rigid motion: a rotation, then a shift.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// By rows.
    pub rotation: [[f64; 3]; 3],
    /// In world units.
    pub shift: [f64; 3],
}

impl Motion {
    /// None.
    pub const NONE: Motion =
        Motion { rotation: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], shift: [0.0; 3] };

    /// Where a point goes.
    pub fn apply(&self, p: [f64; 3]) -> [f64; 3] {
        std::array::from_fn(|a| dot(self.rotation[a], p) + self.shift[a])
    }

    /// Where it came from.
    pub fn undo(&self, p: [f64; 3]) -> [f64; 3] {
        let q = minus(p, self.shift);
        std::array::from_fn(|a| (0..3).map(|n| self.rotation[n][a] * q[n]).sum())
    }

    /// What takes back.
    pub fn inverse(&self) -> Motion {
        let rotation = std::array::from_fn(|a| std::array::from_fn(|b| self.rotation[b][a]));
        let back = Motion { rotation, shift: [0.0; 3] };
        Motion { shift: back.apply(self.shift).map(|c| 0.0 - c), ..back }
    }

    /// A direction, turned.
    pub fn turn(&self, way: [f64; 3]) -> [f64; 3] {
        self.rotation.map(|row| dot(row, way))
    }

    /// By how many degrees it turns.
    pub fn degrees(&self) -> f64 {
        let trace = self.rotation[0][0] + self.rotation[1][1] + self.rotation[2][2];
        (0.5 * (trace - 1.0)).clamp(-1.0, 1.0).acos().to_degrees()
    }
}
