//! Which shells of a mesh are written.

use crate::args::MeshArgs;
use crate::failure::Failure;
use brickfield_engine::contour::{ContourOptions, NestingSink, Shell, ShellSink, contour};
use brickfield_engine::store::BrickTree;
use brickfield_engine::{Progress, Result};
use serde::Serialize;

/// The shells of a mesh, and which of them are kept.
pub struct ShellChoice {
    /// By shell.
    pub kept: Vec<bool>,
    /// By vertex of the whole mesh, its shell.
    pub of: Vec<u32>,
    pub told: Shells,
    /// Triangles of the shells that are kept.
    pub triangles: u64,
}

/// Shells by what they bound.
#[derive(Clone, Copy, Default, PartialEq, Serialize)]
pub struct ShellRegions {
    pub count: usize,
    pub volume: f64,
    /// Bound on its error, where it is not that of triangles.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub volume_error: Option<f64>,
}

impl ShellRegions {
    fn and(self, other: ShellRegions) -> ShellRegions {
        ShellRegions {
            count: self.count + other.count,
            volume: self.volume + other.volume,
            volume_error: None,
        }
    }

    fn add(&mut self, volume: f64) {
        self.count += 1;
        self.volume += volume.abs();
    }
}

/// What was kept and dropped.
#[derive(Clone, Copy, Default, Serialize)]
pub struct Shells {
    /// Shells that face outward, of the mesh as it is written.
    pub pieces: ShellRegions,
    /// Shells that face inward.
    pub voids: ShellRegions,
    pub dropped_pieces: ShellRegions,
    pub dropped_voids: ShellRegions,
}

/// Whether shells are to be told apart, or triangles looked at one by one.
pub fn is_asked(args: &MeshArgs) -> bool {
    args.outer || args.keep_largest || args.quality || args.min_shell_volume.is_some()
}

/// What of the command line is wrong.
///
/// # Errors
/// Wrong usage.
pub fn check(args: &MeshArgs) -> std::result::Result<(), Failure> {
    match args.min_shell_volume {
        Some(volume) if !(volume >= 0.0 && volume.is_finite()) => {
            Err(Failure::Usage(format!("--min-shell-volume {volume}: give a volume, 0 or more")))
        }
        _ => Ok(()),
    }
}

/// Tells the shells of a mesh apart and chooses among them. The mesh is made once for it, or twice if some may lie in others.
///
/// # Errors
/// As [`contour`]; if they do not fit the memory.
pub fn choose(
    args: &MeshArgs,
    tree: &dyn BrickTree,
    options: &ContourOptions,
    memory: u64,
    progress: &dyn Progress,
) -> Result<ShellChoice> {
    let mut sink = ShellSink::new(memory);
    contour(tree, options, &mut sink, progress)?;
    let (shells, of) = sink.into_shells();
    let mut kept: Vec<bool> = vec![true; shells.len()];
    if args.outer || args.keep_largest {
        let mut nesting = NestingSink::new(&shells, &of);
        if !nesting.is_idle() {
            contour(tree, options, &mut nesting, progress)?;
        }
        let within = nesting.within();
        if args.keep_largest {
            keep_largest(&shells, &within, &mut kept);
        }
        if args.outer {
            let is_enclosed = |n: usize| shells[n].volume <= 0.0 || !within[n].is_empty();
            (0..shells.len()).filter(|&n| is_enclosed(n)).for_each(|n| kept[n] = false);
        }
    }
    let least = args.min_shell_volume.unwrap_or(0.0);
    shells.iter().zip(&mut kept).for_each(|(shell, kept)| *kept &= shell.volume.abs() >= least);
    let told = told(&shells, &kept);
    let triangles =
        shells.iter().zip(&kept).filter(|(_, kept)| **kept).map(|(shell, _)| shell.triangles).sum();
    Ok(ShellChoice { kept, of, told, triangles })
}

/// Keeps the piece of the largest volume and the voids in it.
fn keep_largest(shells: &[Shell], within: &[Vec<u32>], kept: &mut [bool]) {
    let by_volume = |&a: &usize, &b: &usize| shells[a].volume.total_cmp(&shells[b].volume).then(b.cmp(&a));
    let Some(largest) = (0..shells.len()).max_by(by_volume) else { return };
    for (n, shell) in shells.iter().enumerate() {
        // A void belongs to the innermost piece around it: the one that lies in as many others as there are more around it.
        let innermost = within[n].iter().max_by_key(|&&outer| within[outer as usize].len());
        kept[n] = n == largest || (shell.volume <= 0.0 && innermost == Some(&(largest as u32)));
    }
}

fn told(shells: &[Shell], kept: &[bool]) -> Shells {
    let mut told = Shells::default();
    for (shell, kept) in shells.iter().zip(kept) {
        let regions = match (shell.volume > 0.0, kept) {
            (true, true) => &mut told.pieces,
            (false, true) => &mut told.voids,
            (true, false) => &mut told.dropped_pieces,
            (false, false) => &mut told.dropped_voids,
        };
        regions.add(shell.volume);
    }
    told
}

impl Shells {
    /// Voids of the mesh before any was left out.
    pub fn all_voids(&self) -> ShellRegions {
        self.voids.and(self.dropped_voids)
    }

    /// Pieces of the mesh before any was left out.
    pub fn all_pieces(&self) -> ShellRegions {
        self.pieces.and(self.dropped_pieces)
    }

    /// Whether anything was left out.
    pub fn has_dropped(&self) -> bool {
        self.dropped_pieces.count + self.dropped_voids.count > 0
    }

    /// What was left out, for people; `None` if it is nothing.
    pub fn text(&self, unit: &str) -> Option<String> {
        let Shells { dropped_pieces: pieces, dropped_voids: voids, .. } = self;
        if !self.has_dropped() {
            return None;
        }
        let of = |regions: &ShellRegions, kind: &str| {
            format!(
                "{} {kind}{}, {:.6} {unit}³",
                regions.count,
                if regions.count == 1 { "" } else { "s" },
                regions.volume
            )
        };
        Some(format!("\n  left out {}; {}", of(pieces, "solid piece"), of(voids, "enclosed void")))
    }
}
