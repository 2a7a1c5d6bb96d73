//! A mesh of a detail or a size: the part as fractions of solid in coarse cells.

use super::mesh::{ExpectedVolume, bytes_a_triangle, tolerance_in};
use super::mesh_quality;
use super::mesh_shells::{self, ShellChoice, ShellRegions, Shells};
use super::{of_store, unit_of};
use crate::args::MeshArgs;
use crate::failure::Failure;
use crate::measured::measured;
use crate::progress::Bars;
use crate::units::{Length, Size};
use anyhow::anyhow;
use brickfield_engine::contour::{ContourOptions, MeshArrays, contour, foresee_triangles};
use brickfield_engine::fraction::{
    DetailRequest, Distances, Lattice, LevelSurface, SizedMesh, distances, factor_of, finest_cell, fractions,
    keep_volume, of_triangles, surface,
};
use brickfield_engine::store::{BrickTree, Store};
use brickfield_engine::voids::{Connectivity, Total, label};
use brickfield_engine::{Error, Progress};
use serde::Serialize;
use std::path::Path;

/// A triangle in memory with its share of vertices and of the boxes by which it is found, while these are sorted.
const DISTANCE_BYTES_A_TRIANGLE: u64 = 200;
/// How far around points of the mesh the store's surface is looked for, in coarse cells.
const REACH: f64 = 2.0;
/// Farther from the mesh, in coarse cells, is what was averaged away.
const FAR: f64 = 1.5;
/// Fewest triangles of a closed surface.
const LEAST_TRIANGLES: u64 = 4;

/// Whether a mesh of fractions is asked for.
pub fn is_asked(args: &MeshArgs) -> bool {
    args.detail.is_some() || args.triangles.is_some() || args.max_size.is_some()
}

/// What of the command line is wrong for such a mesh.
///
/// # Errors
/// Wrong usage.
pub fn check(args: &MeshArgs) -> Result<(), Failure> {
    let what = match (args.iso, args.triangles) {
        (Some(iso), _) if !(iso > 0.0 && iso < 1.0) => {
            format!("--iso {iso}: with --detail it is the fraction of solid at the surface, between 0 and 1")
        }
        (_, Some(most)) if most < LEAST_TRIANGLES => {
            format!("--triangles {most}: a closed surface has {LEAST_TRIANGLES} at least")
        }
        _ => return Ok(()),
    };
    Err(Failure::Usage(what))
}

/// The mesh that is asked for, not written yet, and its shells that are kept. `expected` is the volume of the source, where
/// it is known. The tree is that of the store, or that about another origin.
///
/// # Errors
/// A detail below the store's cells, or one at which nothing is left; too few triangles; what reading gives.
pub fn find_chosen(
    args: &MeshArgs,
    (store, tree): (&Store, &dyn BrickTree),
    (output, bits): (&Path, u8),
    (options, memory): (&ContourOptions, u64),
    expected: Option<&ExpectedVolume>,
    bars: &Bars,
) -> Result<(SizedMesh, ShellChoice), Failure> {
    let most = most_triangles(args, (output, bits))?;
    let least = 0.9 * most as f64;
    let make = |ask: u64| -> Result<(SizedMesh, ShellChoice, u64), Failure> {
        let made = find(args, (store, tree), ask, (options, memory), expected, bars)?;
        if made.kept.summary.triangles == 0 {
            let (path, cell, unit) = (store.path().display(), made.cell(), unit_of(store.meta()));
            return Err(anyhow!(
                "{path}: nothing is left in cells of {cell:.6} {unit}; choose a smaller --detail"
            )
            .into());
        }
        let (chosen, kept) = choose(args, (store, tree, &made), output, (options, memory), bars)?;
        Ok((made, chosen, kept))
    };
    // What was asked for with too few triangles left, and with too many, and how many these were.
    let (mut low, mut high) = ((most, 0), None);
    // What was asked for with the most left that are not too many.
    let (mut best, mut best_ask) = (0, most);
    let (mut ask, mut last) = (most, 0);
    for left in (0..SHELL_TRIES).rev() {
        let (made, chosen, kept) = make(ask)?;
        if kept <= most && kept > best {
            (best, best_ask) = (kept, ask);
        }
        // What is left out makes room for more triangles of the rest.
        let all = made.kept.summary.triangles;
        let is_small = (kept as f64) < least && (all as f64 >= least || (kept as f64) < 0.95 * all as f64);
        let is_all = all == last && (all as f64) < 0.9 * ask as f64;
        if args.detail.is_some() || kept == 0 || kept <= most && !is_small {
            return Ok((made, chosen));
        }
        if made.is_flat() || is_all || left == 0 {
            if ask == best_ask {
                return Ok((made, chosen));
            }
            break;
        }
        last = all;
        if kept > most {
            high = Some((ask, kept))
        } else {
            low = (ask, kept)
        }
        // A mesh has about 0.95 of what is asked for, and so should what is left of it.
        let guess = match high {
            Some(high) if low.1 > 0 => between(low, high, 0.95 * most as f64),
            _ => all as f64 * most as f64 / kept as f64,
        };
        let within = guess > low.0 as f64 && high.is_none_or(|(high, _)| guess < high as f64);
        let middle = (low.0 as f64 * high.map_or(ask, |(high, _)| high) as f64).sqrt();
        ask = if within { guess } else { middle } as u64;
    }
    let (made, chosen, _) = make(best_ask)?;
    Ok((made, chosen))
}

/// What to ask for so that so many triangles are left, between two askings and what they left; not near either.
fn between(low: (u64, u64), high: (u64, u64), left: f64) -> f64 {
    let [(low, few), (high, many)] = [low, high].map(|(ask, left)| (ask as f64, left as f64));
    low + (high - low) * ((left - few) / (many - few)).clamp(0.1, 0.9)
}

/// How often a mesh is made, because shells or slivers of it are left out.
const SHELL_TRIES: usize = 6;

/// The shells of a mesh that are kept, and how many triangles they have in the file.
fn choose(
    args: &MeshArgs,
    (store, whole, made): (&Store, &dyn BrickTree, &SizedMesh),
    output: &Path,
    (options, memory): (&ContourOptions, u64),
    bars: &Bars,
) -> Result<(ShellChoice, u64), Failure> {
    let chosen_tree = made.tree(whole);
    let tree = chosen_tree.as_tree();
    let options = ContourOptions { tolerance: made.tolerance, ..options.clone() };
    let chosen = mesh_shells::choose(args, tree, &options, memory, bars)
        .map_err(|error| of_store(store, "shells", error))?;
    // A mesh of a detail has as many as it has.
    if !args.quality || args.detail.is_some() || chosen.triangles == 0 {
        let kept = chosen.triangles;
        return Ok((chosen, kept));
    }
    let kept = mesh_quality::improved_triangles(&chosen, (store, tree), &options, output, bars)?;
    Ok((chosen, kept))
}

/// The mesh of at most so many triangles, or of the detail that is asked for.
fn find(
    args: &MeshArgs,
    (store, tree): (&Store, &dyn BrickTree),
    most: u64,
    (options, memory): (&ContourOptions, u64),
    expected: Option<&ExpectedVolume>,
    bars: &dyn Progress,
) -> Result<SizedMesh, Failure> {
    let told = |error: Error| of_store(store, "detail", error);
    if let Some(detail) = args.detail {
        let lattice = lattice_of(detail, (store, tree), memory, bars)?;
        let volume = expected.map_or(lattice.volume(), |expected| expected.volume);
        let kept = kept(args, &lattice, volume, options, bars).map_err(told)?;
        return Ok(SizedMesh::of_fractions(lattice, kept, options.tolerance, tree));
    }
    let of_all = foresee_triangles(store, 0.5, None).map_err(told)?;
    let volume = expected.map(|expected| expected.volume);
    let request = DetailRequest { most, of_all, volume, options, memory };
    Ok(of_triangles(tree, request, bars).map_err(told)?)
}

/// The most triangles that are asked for, of a file with coordinates of so many bits.
pub fn most_triangles(args: &MeshArgs, (output, bits): (&Path, u8)) -> Result<u64, Failure> {
    let of_size = args.max_size.map(|Size(bytes)| {
        let most = bytes.saturating_sub(HEADER_BYTES) / most_bytes_a_triangle(args, output, bits);
        if most < LEAST_TRIANGLES {
            return Err(Failure::Usage(format!("--max-size {}: no mesh is so small", Size(bytes))));
        }
        Ok(most)
    });
    let of_size = of_size.transpose()?.unwrap_or(u64::MAX);
    Ok(args.triangles.unwrap_or(u64::MAX).min(of_size))
}

/// The most that a triangle takes in a file; two have a vertex, whose coordinates and normal count by half.
fn most_bytes_a_triangle(args: &MeshArgs, output: &Path, bits: u8) -> u64 {
    let is = |ending: &str| output.extension().is_some_and(|end| end.eq_ignore_ascii_case(ending));
    if is("3mf") {
        // Coordinates of coarse cells are packed less well than those of a lattice.
        return 24;
    }
    let normal = if is("obj") { 36 } else { 7 };
    let double = if bits > 32 && !is("obj") { 7 } else { 0 };
    let has_normals = args.normals && !is("stl");
    bytes_a_triangle(output) + double + if has_normals { normal } else { 0 }
}

/// What a mesh file has beside its triangles.
const HEADER_BYTES: u64 = 1024;

/// The fractions at a detail.
fn lattice_of(
    detail: Length,
    (store, tree): (&Store, &dyn BrickTree),
    memory: u64,
    bars: &dyn Progress,
) -> Result<Lattice, Failure> {
    let unit = unit_of(store.meta());
    let length = detail.in_unit_of(&store.meta().unit).ok_or_else(super::no_unit)?;
    let Some(factor) = factor_of(store, length) else {
        let (path, cell) = (store.path().display(), finest_cell(store));
        return Err(anyhow!(
            "{path}: a detail of {length} {unit} is smaller than the store's cells of {cell:.6} {unit}; leave --detail out or \
             build with --cell"
        )
        .into());
    };
    let mut lattices =
        fractions(tree, &[factor], memory, bars).map_err(|error| of_store(store, "detail", error))?;
    Ok(lattices.pop().expect("one factor gives one lattice"))
}

/// The surface of fractions: that of a fraction given, or the one that keeps the volume.
fn kept(
    args: &MeshArgs,
    lattice: &Lattice,
    volume: f64,
    options: &ContourOptions,
    bars: &dyn Progress,
) -> Result<LevelSurface, Error> {
    if let Some(fraction) = args.iso {
        return surface(lattice, fraction, options, bars);
    }
    let plain = ContourOptions { tolerance: 0.0, ..options.clone() };
    let kept = keep_volume(lattice, volume, None, &plain, bars)?;
    if options.tolerance == 0.0 {
        return Ok(kept);
    }
    keep_volume(lattice, volume, Some(kept.depth), options, bars)
}

/// Options of a mesh of fractions: those of the command line, with what of them counts for its lattice.
///
/// # Errors
/// A tolerance with a unit, of a store without.
pub fn options_of(args: &MeshArgs, store: &Store, cache_bytes: usize) -> Result<ContourOptions, Failure> {
    Ok(ContourOptions {
        cache_bytes,
        tolerance: tolerance_in(args.tolerance, store)?,
        intersection_free: args.intersection_free,
        follow_creases: args.follow_creases,
        temp_dir: args.temp_dir.clone(),
        ..ContourOptions::default()
    })
}

/// What a mesh of fractions is.
#[derive(Serialize)]
pub struct MeshDetail {
    /// Edge of the coarse cells.
    pub cell: f64,
    /// The store's cells in one of them, along an axis.
    pub factor: u32,
    /// Samples in one of them, along an axis.
    pub samples_per_cell: u32,
    /// Whether the surface is that of the store's own cells.
    #[serde(skip)]
    is_own: bool,
    /// The fraction of solid at the surface.
    pub fraction: f64,
    /// How far the surface was moved for the sake of fewer triangles.
    pub tolerance: f64,
    /// Enclosed voids of the store.
    pub voids: ShellRegions,
    /// Solid pieces of the store.
    pub pieces: ShellRegions,
    /// Distances of points of the mesh from the store's surface, and of points of that from the mesh; `None` of meshes that do
    /// not fit the memory.
    pub distances: Option<[Distances; 2]>,
}

impl MeshDetail {
    /// Of a mesh and the store that it is of.
    ///
    /// # Errors
    /// What reading the store gives.
    pub fn of(made: &SizedMesh, store: &Store, bars: &dyn Progress) -> Result<MeshDetail, Failure> {
        let fine =
            label(store, Connectivity::default(), bars).map_err(|error| of_store(store, "detail", error))?;
        let of = |solid: bool| {
            let count = fine.components.iter().filter(|component| component.solid == solid).count();
            let Total { value, error } = fine.total(store.root(), solid);
            ShellRegions { count, volume: value, volume_error: Some(error) }
        };
        Ok(MeshDetail {
            cell: made.cell(),
            factor: made.factor(),
            samples_per_cell: made.samples_per_cell(),
            is_own: made.is_own(),
            fraction: made.kept.fraction,
            tolerance: made.tolerance,
            voids: of(false),
            pieces: of(true),
            distances: None,
        })
    }

    /// Measures distances, if the mesh fits the memory.
    ///
    /// # Errors
    /// What reading the store gives.
    pub fn measure(
        &mut self,
        made: &SizedMesh,
        (options, memory): (&ContourOptions, u64),
        (store, whole): (&Store, &dyn BrickTree),
        bars: &dyn Progress,
    ) -> Result<(), Failure> {
        if made.kept.summary.triangles.saturating_mul(DISTANCE_BYTES_A_TRIANGLE) > memory {
            return Ok(());
        }
        let mut mesh = MeshArrays::default();
        contour(made.tree(whole).as_tree(), options, &mut mesh, bars)?;
        let reach = REACH * self.cell + self.tolerance;
        let found = distances(whole, &mesh, (FAR * self.cell, reach), bars)
            .map_err(|error| of_store(store, "distances", error))?;
        self.distances = Some(found);
        Ok(())
    }

    /// For people.
    pub fn text(&self, shells: &Shells, unit: &str) -> String {
        let MeshDetail { cell, factor, tolerance, voids, pieces, distances, .. } = self;
        let [of_voids, mut of_pieces] = [shells.all_voids(), shells.all_pieces()];
        // Shells enclose their voids as well.
        of_pieces.volume -= of_voids.volume;
        let mut text = self.cells_text(unit);
        if *tolerance > 0.0 {
            text += &format!("; tolerance {tolerance:.6} {unit}");
        }
        text += &format!("\n  voids    {}", compared((voids, &of_voids), unit, "enclosed"));
        text += &format!("\n  pieces   {}", compared((pieces, &of_pieces), unit, "solid"));
        if let Some([of_mesh, of_store]) = distances {
            let error = 0.5 * cell / f64::from(*factor);
            let told = |distances: &Distances| {
                let Distances { mean, of_999, largest, .. } = *distances;
                let [mean, of_999, largest] = [mean, of_999, largest].map(|length| measured(length, error));
                format!("mean {mean} {unit}, 99.9% within {of_999}, all within {largest}")
            };
            text += &format!(
                "\n  distance of the mesh from the store's surface at {} points: {}",
                of_mesh.points,
                told(of_mesh)
            );
            text += &format!(
                "\n  distance of that surface from the mesh at {} points: {}",
                of_store.points,
                told(of_store)
            );
            if of_store.beyond > 0.0 {
                let percent = 100.0 * of_store.beyond;
                text += &format!("; {percent:.1}% of them are farther than {:.6}: averaged away", FAR * cell);
            }
        }
        text
    }
}

impl MeshDetail {
    /// What cells the surface is of, for people.
    fn cells_text(&self, unit: &str) -> String {
        let MeshDetail { cell, factor, samples_per_cell, fraction, .. } = self;
        if self.is_own {
            return format!("\n  detail   the store's own cells of {cell:.6} {unit}");
        }
        let sampled = match samples_per_cell {
            1 => String::new(),
            samples => format!(", with {samples} samples in each"),
        };
        let percent = 100.0 * fraction;
        format!(
            "\n  detail   cells of {cell:.6} {unit}, {factor} of the store's an axis{sampled}; the surface is where {percent:.1}% is \
             solid"
        )
    }
}

/// Regions of the store and what of them is in the mesh.
fn compared((fine, coarse): (&ShellRegions, &ShellRegions), unit: &str, kind: &str) -> String {
    let volume = measured(fine.volume, fine.volume_error.unwrap_or_default());
    let all = format!("{} {kind} in the store, {volume} {unit}³", fine.count);
    if fine.count == coarse.count {
        return format!("{all}; as many in the mesh, {:.6} {unit}³", coarse.volume);
    }
    let what = if coarse.count < fine.count {
        "the others are smaller than cells and averaged away"
    } else {
        "what narrows below a cell is cut apart there"
    };
    format!("{all}; {} in the mesh, {:.6} {unit}³: {what}", coarse.count, coarse.volume)
}

/// A warning that a mesh has fewer than nine tenths of the triangles that were asked for, and why.
pub fn fewer_triangles(args: &MeshArgs, made: &SizedMesh, triangles: u64, most: u64) -> Option<String> {
    let least = most / 10 * 9;
    let why = if made.kept.summary.triangles >= least {
        "the others were slivers, or of shells that are left out"
    } else if made.is_own() && made.is_flat() {
        "flat faces are merged, and more triangles would be no nearer to the store's surface"
    } else if made.factor() == 1 && made.tolerance == 0.0 {
        "the store has no more"
    } else {
        "of the meshes that were tried, none with more of them was found better"
    };
    let asked = match args.max_size {
        Some(size) if args.triangles != Some(most) => format!("for which --max-size {size} has room"),
        _ => "which were asked for".to_owned(),
    };
    let told = format!("{triangles} triangles are fewer than nine tenths of {most}, {asked}: {why}");
    (triangles < least).then_some(told)
}

/// By how much of its volume a mesh may be off before a warning says so.
const MOST_OFF: f64 = 1e-3;

/// A warning that a mesh does not hold the volume, where it could not.
pub fn lost_volume(
    args: &MeshArgs,
    made: &SizedMesh,
    expected: &ExpectedVolume,
    unit: &str,
) -> Option<String> {
    let off = (made.kept.summary.volume - expected.volume).abs();
    if off <= expected.error.max(MOST_OFF * expected.volume) {
        return None;
    }
    let (volume, there) = (made.kept.summary.volume, measured(expected.volume, expected.error));
    let remedy = if args.detail.is_some() {
        "a smaller --detail"
    } else if args.triangles.is_some() {
        "more --triangles"
    } else {
        "a larger --max-size"
    };
    Some(format!(
        "the mesh holds {volume:.3} {unit}³ of {there} {unit}³: no surface of cells of {:.6} {unit} was found that holds it, as \
         where walls or gaps are narrower; try {remedy}",
        made.cell()
    ))
}
