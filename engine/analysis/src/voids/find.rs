//! The voids of a store, one by one.

use super::around::Tracer;
use super::boundary::{Boundaries, boundaries};
use super::cad::cad_shares;
use super::classify::class_of;
use super::components::Connectivity;
use super::infill::has_sparse_infill;
use super::labelling::{Component, Labelling, label};
use super::points::{ByComponent, Point, PointTree, gap, inscribed};
use super::pores::{Pore, Pores, pores};
use super::sealed::{SealFindings, SubcellField, sealed};
use super::surface::{FARTHEST_BYTES, VoidSurface, surfaces};
use super::totals::Total;
use super::trace::Trace;
use super::void::{Seal, Void};
use crate::error::Result;
use crate::lattice::RootCube;
use crate::progress::Progress;
use crate::soup::Facets;
use crate::store::{BrickTree, Store};
use rayon::prelude::*;

/// Bytes that a point of a boundary takes while distances are measured.
const POINT_BYTES: u64 = 64;

/// Bytes of a void with its sums and its surface while it is measured, at most. A constant, because which distances are found
/// depends on it.
const VOID_BYTES: u64 = 1412;
const _: () = assert!(
    size_of::<Void>() + size_of::<Component>() + size_of::<VoidSurface>() + FARTHEST_BYTES
        <= VOID_BYTES as usize
);
/// Bytes for bricks and points however many voids there are.
const LEAST_BYTES: u64 = 32 << 20;
/// Largest balls are found to this share of a cell.
const NEARER_BALL: f64 = 0.001;

/// What to look for.
#[derive(Clone, Copy)]
pub struct VoidOptions<'a> {
    /// Which samples are neighbours.
    pub connectivity: Connectivity,
    /// Smaller voids are left out, in the cube of the store's unit.
    pub min_volume: f64,
    /// Bytes for bricks and for points of boundaries.
    pub memory: u64,
    /// The CAD part on the same lattice, to tell what of a void lies inside it.
    pub cad: Option<&'a Store>,
    /// Voids count, too, that open to the outside only through throats narrower than this, in the store's unit.
    pub closing: Option<f64>,
    /// What is asked of voids.
    pub detail: Detail,
    /// The closed meshes that the store was built from, to tell what lies between samples.
    pub source: Option<&'a [&'a dyn Facets]>,
}

impl Default for VoidOptions<'_> {
    /// All voids that are sealed from the outside between samples, within 256 MiB.
    fn default() -> Self {
        VoidOptions {
            connectivity: Connectivity::VoidSix,
            min_volume: 0.0,
            memory: 256 << 20,
            cad: None,
            source: None,
            closing: None,
            detail: Detail::All,
        }
    }
}

/// What is asked of voids. Each takes several times as long as the one before, and numbers are the same.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Detail {
    /// Number, volume, surface and place alone.
    Volumes,
    /// Class, beads around, and distances as well.
    Classes,
    /// Everything; with less no void is sealed for certain.
    All,
}

/// The voids of a store.
pub struct Voids {
    /// All leaves, and the components of these.
    pub(super) labelling: Labelling,
    /// Pores, if they were asked for.
    pub(super) pores: Option<Pores>,
    /// Largest first.
    pub voids: Vec<Void>,
    /// Volume of the solid.
    pub solid_volume: Total,
    /// Pieces of solid that do not hang together.
    pub solids: usize,
    /// Volume of all voids, those left out as well.
    pub void_volume: Total,
    /// How many were left out as too small.
    pub left_out: usize,
    /// The cell of the grid on which throats were measured.
    pub throat_cell: Option<f64>,
    /// The source that was given has other samples than the store, so it was not asked.
    pub source_differs: bool,
}

impl Voids {
    /// Bytes that the components of all leaves take, and the pores.
    pub fn label_bytes(&self) -> u64 {
        self.labelling.heap_bytes() + self.pores.as_ref().map_or(0, Pores::heap_bytes)
    }

    /// Volume of voids over that of solid and voids.
    pub fn porosity(&self) -> Total {
        self.void_volume.share_beside(self.solid_volume)
    }
}

/// Finds the voids of a store.
///
/// # Errors
/// What reading the store gives; [`crate::error::Error::Interrupted`].
pub fn find(store: &Store, options: &VoidOptions<'_>, progress: &dyn Progress) -> Result<Voids> {
    let labelling = label(store, options.connectivity, progress)?;
    let memory = options.memory / 2;
    let pores = options.closing.map(|closing| pores(store, closing, memory, progress)).transpose()?;
    let mut found = Voids {
        throat_cell: pores.as_ref().map(Pores::cell),
        labelling,
        pores,
        voids: Vec::new(),
        solid_volume: Total::default(),
        solids: 0,
        void_volume: Total::default(),
        left_out: 0,
        source_differs: false,
    };
    let measured = found.count(store);
    if measured.contains(&true) || !found.voids.is_empty() {
        found.measure(store, options, &measured, progress)?;
    }
    // Components are in Morton order of their first leaves, which settles ties.
    found.voids.sort_by(|a, b| b.volume.total_cmp(&a.volume).then(a.component.cmp(&b.component)));
    found.voids.iter_mut().enumerate().for_each(|(n, void)| void.id = n + 1);
    Ok(found)
}

impl Voids {
    /// Sums over all components; gives those that are to be measured, and makes voids of pores.
    fn count(&mut self, store: &Store) -> Vec<bool> {
        let root = store.root();
        let measured: Vec<bool> =
            self.labelling.components.iter().map(|component| !component.solid).collect();
        self.solids = measured.iter().filter(|is_void| !**is_void).count();
        [self.solid_volume, self.void_volume] = [true, false].map(|solid| self.labelling.total(root, solid));
        if let Some(source) = &store.meta().volumes {
            let source = Total { value: source.union.value, error: source.union.bound() };
            self.solid_volume = self.solid_volume.not_nearer_than(source);
        }
        let Some(pores) = &self.pores else { return measured };
        for (number, pore) in pores.pores.iter().enumerate() {
            let void = void_of_pore(pores, pore, self.labelling.components.len() + number);
            self.void_volume.value += void.volume;
            self.void_volume.error += void.volume_error;
            self.voids.push(void);
        }
        measured
    }

    /// Measures all that are to be.
    fn measure(
        &mut self,
        store: &Store,
        options: &VoidOptions<'_>,
        measured: &[bool],
        progress: &dyn Progress,
    ) -> Result<()> {
        let root = store.root();
        let labelling = &self.labelling;
        let is_void = |component: usize| measured[component];
        let centre = |component: usize| {
            let centroid = labelling.components[component].sums.centroid()?;
            is_void(component).then(|| root.to_world(centroid))
        };
        // What is kept of voids is not there for bricks and points.
        let count = measured.iter().filter(|is_measured| **is_measured).count();
        let rest = (options.memory / 2).saturating_sub(count as u64 * VOID_BYTES).max(LEAST_BYTES);
        let cache_bytes = usize::try_from(rest).unwrap_or(usize::MAX);
        let cell = root.spacing(store.meta().depth);
        let mut found = Vec::with_capacity(count);
        surfaces(store, labelling, &centre, cache_bytes, progress, |component, surface| {
            found.push(void_of(labelling, component, surface, (root, cell)));
        })?;
        self.take(measured, found, (root, cell));
        let kept = self.leave_out(options.min_volume, measured.len());
        if options.detail == Detail::Volumes {
            return Ok(());
        }
        let labelling = &self.labelling;
        let is_kept = |component: usize| kept[component];
        let tracer = Tracer::new(store)?;
        let most = usize::try_from(rest / POINT_BYTES).unwrap_or(usize::MAX);
        let pores = self.pores.as_ref();
        let Boundaries { voids: points, outer, around } =
            boundaries(store, labelling, &is_void, pores, tracer.as_ref(), most, progress)?;
        let is_sparse = tracer.as_ref().is_some_and(|tracer| has_sparse_infill(around.values(), tracer));
        if let Some(tracer) = &tracer {
            for void in &mut self.voids {
                if let Some(around) = around.get(&void.component) {
                    void.trace = Trace::of(around, tracer, is_sparse)?.map(Box::new);
                }
            }
        }
        if let Some(cad) = options.cad {
            let shares = cad_shares(store, cad, labelling, &is_kept, progress)?;
            self.voids.iter_mut().for_each(|void| void.cad_share = shares.get(&void.component).copied());
        }
        let source = match (&tracer, options.source) {
            (Some(tracer), _) => SubcellField::Beads(tracer),
            (None, Some(meshes)) => SubcellField::Meshes(meshes),
            (None, None) => SubcellField::Samples,
        };
        let sealed = match options.detail {
            Detail::All => sealed(store, labelling, &is_kept, source, progress)?,
            Detail::Volumes | Detail::Classes => SealFindings::default(),
        };
        self.source_differs = sealed.source_differs;
        for void in &mut self.voids {
            if sealed.certain.contains(&void.component) {
                void.seal = Seal::Certain;
            } else if sealed.open.contains(&void.component) {
                (void.seal, void.throat) = (Seal::Open, f64::NAN);
            }
        }
        let components = self.labelling.components.len();
        if let Some(points) = points {
            measure_distances(&mut self.voids, (points, outer), store, components, progress)?;
        }
        self.voids.iter_mut().for_each(|void| void.class = class_of(void, is_sparse));
        Ok(())
    }

    /// Takes the voids that have a surface, in any order, and makes the others.
    fn take(&mut self, measured: &[bool], mut found: Vec<Void>, (root, cell): (RootCube, f64)) {
        let mut is_found = vec![false; measured.len()];
        found.iter().for_each(|void| is_found[void.component] = true);
        for number in (0..measured.len()).filter(|&number| measured[number] && !is_found[number]) {
            found.push(void_of(&self.labelling, number, VoidSurface::default(), (root, cell)));
        }
        found.sort_unstable_by_key(|void| void.component);
        let mut apart = 0.0;
        for void in &found {
            apart += void.volume - Total::of(&self.labelling.components[void.component].sums, root).value;
        }
        self.void_volume.value += apart;
        self.void_volume.error += apart.abs();
        found.append(&mut self.voids);
        self.voids = found;
    }

    /// Leaves out voids below a volume. So what is left, and all totals, are the same whatever the volume; gives those components,
    /// of so many, that stay.
    fn leave_out(&mut self, min_volume: f64, components: usize) -> Vec<bool> {
        let all = self.voids.len();
        self.voids.retain(|void| void.volume >= min_volume);
        self.left_out = all - self.voids.len();
        let mut kept = vec![false; components];
        for void in self.voids.iter().filter(|void| void.component < components) {
            kept[void.component] = true;
        }
        kept
    }

    /// The numbers of the voids, from 1, by component and pore; 0 of all that are none.
    pub(super) fn numbers(&self) -> Vec<u32> {
        let pores = self.pores.as_ref().map_or(0, |pores| pores.pores.len());
        let mut numbers = vec![0; self.labelling.components.len() + pores];
        self.voids.iter().for_each(|void| numbers[void.component] = void.id as u32);
        numbers
    }
}

fn void_of_pore(pores: &Pores, pore: &Pore, component: usize) -> Void {
    let cell = pores.cell();
    let bounds = pores.bounds(pore);
    Void {
        id: 0,
        class: None,
        seal: Seal::Open,
        throat: pore.throat(cell),
        component,
        cad_share: None,
        volume: pore.samples as f64 * cell.powi(3),
        // Of the cells beside others any part may be the pore's.
        volume_error: pore.border as f64 * cell.powi(3),
        surface: 0.0,
        inner_diameter: pores.inner(pore),
        diameter: (0..3).map(|a| (bounds[1][a] - bounds[0][a]).powi(2)).sum::<f64>().sqrt(),
        centroid: pores.centroid(pore),
        bounds,
        euler: None,
        gap: None,
        edge_distance: None,
        trace: None,
        elongation: None,
        projected: None,
    }
}

/// What a volume may be off by though the chords along three axes agree: they may do so by chance. Half a cell for each cell
/// along the side of a cube of that volume, and up to three cells of what is as small as a few, most of which may lie between
/// samples. Of 10,002 random shapes none was off by more than its chords or this tell; capsules thinner than a cell came nearest.
fn least_error(volume: f64, cell: f64) -> f64 {
    let cells = volume.max(0.0) / cell.powi(3);
    (0.5 * cells.cbrt()).max(3.0 / (1.0 + cells / 8.0)) * cell.powi(3)
}

/// The volume within the polygons, if these are closed, else that of the chords. Chords are off where
/// faces are in step with the cells; polygons are not, but the bound is that of the chords, and what the two differ by.
fn by_polygons(surface: &VoidSurface, chords: Total) -> (f64, f64) {
    /// A surface is closed if its vectors of area add up to nothing but rounding.
    const OPEN_MOST: f64 = 1e-4;
    let open = surface.open.iter().map(|c| c * c).sum::<f64>().sqrt();
    let apart = (surface.volume - chords.value).abs();
    if surface.volume > 0.0 && open <= OPEN_MOST * surface.area {
        (surface.volume, chords.error + apart)
    } else {
        (chords.value, chords.error)
    }
}

fn void_of(
    labelling: &Labelling,
    number: usize,
    surface: VoidSurface,
    (root, cell): (RootCube, f64),
) -> Void {
    let sums = &labelling.components[number].sums;
    let chords = Total::of(sums, root);
    let (volume, volume_error) = by_polygons(&surface, chords);
    let volume_error = volume_error.max(least_error(volume, cell));
    let centroid = sums.centroid().map_or([f64::NAN; 3], |units| root.to_world(units));
    let corner = |parts: &[i64; 3]| root.to_world(parts.map(|p| p as f64 / super::measure::PARTS + 1.0));
    let (low, high) = (corner(&sums.low), corner(&sums.high));
    let bounds = [
        [0, 1, 2].map(|a| low[a].min(surface.bounds[0][a])),
        [0, 1, 2].map(|a| high[a].max(surface.bounds[1][a])),
    ];
    Void {
        id: 0,
        class: None,
        seal: Seal::ToCell,
        throat: 0.0,
        component: number,
        cad_share: None,
        volume,
        volume_error,
        surface: surface.area,
        inner_diameter: None,
        diameter: surface.diameter,
        centroid,
        bounds,
        euler: (labelling.connectivity == Connectivity::VoidSix && !labelling.components[number].uneven)
            .then_some(sums.euler),
        gap: None,
        edge_distance: None,
        trace: None,
        elongation: surface.elongation(),
        projected: Some(surface.projected),
    }
}

/// Largest balls, and distances to other voids and, if there are points of it, to the outer surface.
fn measure_distances(
    voids: &mut [Void],
    (points, outer): (Vec<Point>, Option<Vec<Point>>),
    store: &Store,
    components: usize,
    progress: &dyn Progress,
) -> Result<()> {
    let root = store.root();
    let unit = root.unit();
    let cell = root.spacing(store.meta().depth) / unit;
    let reach = 0.75 * cell;
    let by_component = ByComponent::of(&points);
    let (outer, points) = (outer.map(PointTree::new), PointTree::new(points));
    progress.phase("distances between voids", Some(voids.len() as u64), "voids");
    voids.par_iter_mut().try_for_each(|void| {
        progress.check()?;
        let component = void.component as u32;
        let tree = PointTree::new(by_component.points(component).to_vec());
        let nearest = |others: &PointTree| Some(gap(&tree, others, component, reach)? * unit);
        void.edge_distance = outer.as_ref().and_then(nearest);
        void.gap = nearest(&points);
        progress.advance(1);
        if void.component >= components {
            // The grid has told; its boundary is open.
            return Ok(());
        }
        let largest = void.diameter / unit;
        let ball = inscribed(&tree, largest.max(reach), NEARER_BALL * cell) * unit;
        // A ball that is larger than the void says that the void is too small for its cells.
        let most = void.equivalent_diameter() * 1.001;
        void.inner_diameter = (ball > 0.0 && ball <= most).then(|| ball.min(void.equivalent_diameter()));
        Ok(())
    })
}
