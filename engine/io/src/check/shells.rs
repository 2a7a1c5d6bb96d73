//! Area, volume and Euler characteristic, shell by shell.

use super::report::ShellReport;
use super::topology::ConcurrentSets;
use super::{CHUNK, Mesh};
use crate::error::Result;
use crate::progress::Progress;

/// What the triangles add up to.
pub(super) struct MeshMeasures {
    pub(super) area: f64,
    pub(super) volume: f64,
    pub(super) bounds: Option<[[f64; 3]; 2]>,
    /// In the order of their first triangles.
    pub(super) shells: Vec<ShellReport>,
}

/// A sum that carries its rounding error along (Neumaier 1974).
#[derive(Clone, Copy, Default)]
struct Sum {
    sum: f64,
    error: f64,
}

impl Sum {
    fn add(&mut self, term: f64) {
        let sum = self.sum + term;
        self.error +=
            if self.sum.abs() >= term.abs() { self.sum - sum + term } else { term - sum + self.sum };
        self.sum = sum;
    }

    fn total(self) -> f64 {
        self.sum + self.error
    }
}

/// Sums of a shell. Its volume is that of tetrahedra with their tip at `origin`, a corner of the shell: a cavity of a few
/// cells far from the file's origin would drown in rounding otherwise.
struct Sums {
    triangles: u64,
    euler: i64,
    twice_area: Sum,
    six_volumes: Sum,
    origin: [f64; 3],
}

/// Adds up all whole triangles in the order of the file, on one thread, so that the sums are the
/// same whatever the number of threads. Terms are rounded to f64, their sum is not.
///
/// # Errors
/// If the user interrupts.
pub(super) fn measure(
    mesh: &Mesh,
    patches: ConcurrentSets,
    euler: Vec<i8>,
    progress: &dyn Progress,
) -> Result<MeshMeasures> {
    progress.phase("measuring", Some(mesh.triangles.len() as u64), "triangles");
    let mut shells: Vec<Sums> = Vec::new();
    // The number of the shell that begins with a triangle, and later of every triangle.
    let mut shell_of = vec![0u32; mesh.triangles.len()];
    let (mut min, mut max) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for triangle in 0..mesh.triangles.len() {
        if triangle % CHUNK == 0 {
            progress.check()?;
            progress.advance(CHUNK.min(mesh.triangles.len() - triangle) as u64);
        }
        if !mesh.is_whole(triangle) {
            continue;
        }
        let corners = mesh.corners(triangle);
        for corner in corners {
            min = std::array::from_fn(|a| min[a].min(corner[a]));
            max = std::array::from_fn(|a| max[a].max(corner[a]));
        }
        // A shell's name is its first triangle, which was here before.
        let first = patches.root(triangle as u32) as usize;
        if first == triangle {
            shell_of[triangle] = shells.len() as u32;
            let (twice_area, six_volumes) = (Sum::default(), Sum::default());
            shells.push(Sums { triangles: 0, euler: 0, twice_area, six_volumes, origin: corners[0] });
        }
        let shell = &mut shells[shell_of[first] as usize];
        let [a, b, c] = corners.map(|corner| minus(corner, shell.origin));
        let normal = cross(minus(b, a), minus(c, a));
        shell.triangles += 1;
        shell.euler += i64::from(euler[triangle]);
        shell.twice_area.add(dot(normal, normal).sqrt());
        shell.six_volumes.add(dot(a, cross(b, c)));
    }
    let shells: Vec<ShellReport> = shells.iter().map(Sums::shell).collect();
    let total = |of: fn(&ShellReport) -> f64| {
        let mut sum = Sum::default();
        shells.iter().for_each(|shell| sum.add(of(shell)));
        sum.total()
    };
    // Adding zero makes +0 of −0.
    let bounds = (!shells.is_empty()).then(|| [min, max].map(|corner| corner.map(|c| c + 0.0)));
    Ok(MeshMeasures { area: total(|s| s.area), volume: total(|s| s.volume), bounds, shells })
}

impl Sums {
    fn shell(&self) -> ShellReport {
        ShellReport {
            triangles: self.triangles,
            euler_characteristic: self.euler,
            area: self.twice_area.total() / 2.0,
            volume: self.six_volumes.total() / 6.0,
            at: self.origin,
        }
    }
}

fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|n| a[n] - b[n])
}

fn cross(u: [f64; 3], v: [f64; 3]) -> [f64; 3] {
    [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]
}

fn dot(u: [f64; 3], v: [f64; 3]) -> f64 {
    u[0] * v[0] + u[1] * v[1] + u[2] * v[2]
}
