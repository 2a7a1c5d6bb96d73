//! `brickfield deviation`: a part against what it should be.

use super::deviation_tables::{BeadTableFiles, CreatedTables, FilledTable};
use super::mesh_place::{MeshPlace, ends_in};
use super::reference::{Compared, OpenReference, open_reference, point_text, require_alike, sizes};
use super::thickness::{layers_of, place_of, require_numbers};
use super::{no_unit, of_store, open_store, require_whole_samples, start, unit_of};
use crate::distance_args::{AlignArg, DeviationArgs};
use crate::failure::Failure;
use crate::output::{in_line, note, print, print_json, require_distinct, warn};
use crate::progress::Bars;
use crate::table::{Table, TableKind, to_place};
use crate::units::Unit;
use anyhow::anyhow;
use brickfield_engine::contour::{ContourOptions, contour};
use brickfield_engine::distance::deviation::{
    ABSOLUTE_PERCENTILES, Motion, PERCENTILES, Reference, Spread, at_points, of_surface, regions_beyond,
};
use brickfield_engine::distance::{
    ALIGNED_POINTS, Align, PointNumbers, PreviousPlace, Region, ScalarMesh, ScalarPoints, Sides, Surface,
    align, deviation_by_bead,
};
use brickfield_engine::part::{PartFile, directory_of};
use brickfield_engine::store::{AcceptedStores, BrickTree, MovedTree, Store};
use serde_json::{Value, json};
use std::borrow::Cow;
use std::path::{Path, PathBuf};

/// Points of the reference that are compared with the part, at most, of each kind.
const POINTS_BACK: usize = 500_000;
/// A shift is told that is larger than this part of the size while the sizes differ by less.
const SHIFTED: f64 = 0.02;
/// Names of the columns, in order.
const COLUMNS: [&str; 11] = [
    "id",
    "side",
    "area",
    "volume",
    "max_deviation",
    "mean_deviation",
    "x",
    "y",
    "z",
    "layer_first",
    "layer_last",
];

/// What was found of a part and its reference.
struct Comparison {
    there: Spread,
    back: Spread,
    /// Vertices, and triangles, of the part's mesh.
    counts: (u64, u64),
    how: Align,
    motion: Motion,
    /// The root of the mean square that aligning left.
    residual: f64,
    /// The deviation that is allowed, and how many vertices are beyond it.
    beyond: Option<(f64, usize)>,
}

/// Runs the command.
pub fn run(args: &DeviationArgs) -> Result<(), Failure> {
    let wanted = WantedFiles::new(args)?;
    let bars = start(args.work)?;
    let store = open_part(args)?;
    let unit = &store.meta().unit;
    let within = args.within.map(|length| length.in_unit_of(unit).ok_or_else(no_unit)).transpose()?;
    let bead_tables = wanted.by_bead.tables_of(&store)?;
    let place = place_of(&store, &args.output, args.origin)?;
    let OutputFiles { mut mesh, regions, by_bead, points } = wanted.create(args, &store, &place)?;
    let compared = Compared {
        reference: &args.reference,
        output: &args.output,
        folder: folder(args),
        memory: args.memory.0,
        io: args.io,
        align: args.align,
    };
    let opened = open_reference(&compared, &store, &bars)?;
    let sides_of_reference = opened.sides()?;
    let part = Part::new(args, &store, &bars)?;
    let reference_at =
        |motion| opened.reference(sides_of_reference.as_ref(), (&part.surface, &part.sides), motion);
    require_alike(&compared, part.bounds, reference_at(Motion::NONE))?;
    part.contour_into(&mut mesh, &place, &bars)?;
    let (how, counts) = (Align::from(args.align), mesh.counts());
    let positions = mesh.some_positions(ALIGNED_POINTS);
    let (motion, residual) = align(&positions, part.bounds, reference_at(Motion::NONE), how)?;
    let reference = reference_at(motion);
    let values = mesh.fill(&bars, |last: &mut PreviousPlace, world| {
        Ok(reference.opposite_next(motion.apply(world), last)?.signed as f32)
    })?;
    let (back, points) = part.back(&opened, (reference, motion), points, &bars)?;
    let regions = regions.zip(within).map(|(file, within)| {
        Ok::<_, Failure>((file, regions_beyond(&part.surface, reference, (motion, within), &bars)?))
    });
    let regions = regions.transpose()?;
    let by_bead = bead_tables.map(|tables| {
        let found = deviation_by_bead((&store, &tables), &part.surface, (reference, motion), &bars)?;
        Ok::<_, Failure>(by_bead.filled((&found, &tables), part.surface.cell()))
    });
    let by_bead = by_bead.transpose()?;
    let [there, back] = [Spread::of(&values), Spread::of(&back)];
    let beyond = within.map(|within| (within, values.iter().filter(|value| value.abs() > within).count()));
    let comparison = Comparison { there, back, counts, how, motion, residual, beyond };
    comparison.tell_if_apart(args);
    let mut document = comparison.document(args, &store, opened.kind(), &place);
    let mut summary = comparison.summary(args, &store, regions.as_ref().map(|(_, found)| found));
    let mut tables: Vec<FilledTable> = Vec::new();
    if let Some(((file, kind), found)) = regions {
        tables.push(("regions", table(&store, &found, part.surface.cell())?, file, kind));
    }
    tables.extend(by_bead.into_iter().flatten());
    tables.iter().for_each(|(name, table, ..)| document[name] = table.objects());
    bars.clear();
    mesh.complete()?;
    points.map(|mut points| points.complete()).transpose()?;
    place.tell(&store, &args.output)?;
    for (_, table, mut file, kind) in tables {
        table.append_to(&mut file, kind, &document)?;
        file.finish()?;
    }
    if args.json {
        print_json(&document)?;
    } else if !args.work.quiet {
        summary.extend(place.line(unit_of(store.meta())).map(|line| format!("\norigin {line}")));
        print(&summary)?;
    }
    tell_shift(args, part.bounds, reference.bounds(), unit_of(store.meta()));
    comparison.require_within(args, part.surface.cell())
}

/// The files to write, by the names that were typed.
struct WantedFiles<'a> {
    regions: Option<(&'a Path, TableKind)>,
    by_bead: BeadTableFiles<'a>,
    points: Option<&'a Path>,
}

/// These files, made before work begins.
struct OutputFiles {
    mesh: ScalarMesh,
    regions: Option<(PartFile, TableKind)>,
    by_bead: CreatedTables,
    points: Option<PartFile>,
}

impl<'a> WantedFiles<'a> {
    /// Those of the command line, if all can be written by their names.
    fn new(args: &'a DeviationArgs) -> Result<WantedFiles<'a>, Failure> {
        require_numbers(&args.output)?;
        let points = args.reference_points.as_deref();
        points.map(require_ply).transpose()?;
        let regions = args.regions.as_deref().map(|path| Ok::<_, Failure>((path, TableKind::of(path)?)));
        Ok(WantedFiles { regions: regions.transpose()?, by_bead: BeadTableFiles::new(args)?, points })
    }

    fn create(self, args: &DeviationArgs, store: &Store, place: &MeshPlace) -> Result<OutputFiles, Failure> {
        let regions = self.regions.map(|(path, kind)| Ok::<_, Failure>((PartFile::create(path)?, kind)));
        let by_bead = self.by_bead.create()?;
        let points = self.points.map(PartFile::create).transpose()?;
        let metres = Unit::of_symbol(&store.meta().unit).map(Unit::metres);
        let from = (place.base().unwrap_or_default(), place.coordinates());
        let file = PartFile::create(&args.output)?;
        let mesh = ScalarMesh::new(file, "deviation", metres, from, waiting(args))?;
        Ok(OutputFiles { mesh, regions: regions.transpose()?, by_bead, points })
    }
}

/// Where temporary files lie.
fn folder(args: &DeviationArgs) -> &Path {
    args.temp_dir.as_deref().unwrap_or(directory_of(&args.output))
}

/// The memory for what waits for its numbers, and where it lies beyond that.
fn waiting(args: &DeviationArgs) -> (u64, &Path) {
    (args.memory.0 / 8, folder(args))
}

/// The store of the part, whose deviation can be told, if nothing is written over what is read.
fn open_part(args: &DeviationArgs) -> Result<Store, Failure> {
    let store = open_store(&args.store, args.memory.0 / 8, args.io, AcceptedStores::Whole)?;
    let others = [&args.regions, &args.layers, &args.features, &args.reference_points];
    let others = others.into_iter().flatten().map(PathBuf::as_path);
    let outputs: Vec<&Path> = std::iter::once(args.output.as_path()).chain(others).collect();
    require_distinct(&outputs, &[&args.store, &args.reference])?;
    require_whole_samples(&store, "its deviation cannot be told")?;
    Ok(store)
}

/// The part that is compared.
struct Part<'a> {
    args: &'a DeviationArgs,
    store: &'a Store,
    surface: Surface,
    sides: Sides<'a>,
    bounds: [[f64; 3]; 2],
}

impl<'a> Part<'a> {
    fn new(args: &'a DeviationArgs, store: &'a Store, bars: &Bars) -> Result<Part<'a>, Failure> {
        let surface = Surface::new(store, args.memory.0 / 4, folder(args), bars)
            .map_err(|error| of_store(store, "surface", error))?;
        let Some(bounds) = surface.bounds() else {
            let what = "the store has no surface; build it with finer cells";
            return Err(anyhow!("{}: {what}", in_line(&args.store)).into());
        };
        Ok(Part { args, store, surface, sides: Sides::new(store)?, bounds })
    }

    /// Writes its triangles.
    fn contour_into(&self, mesh: &mut ScalarMesh, place: &MeshPlace, bars: &Bars) -> Result<(), Failure> {
        let cache_bytes = (self.args.memory.0 / 4) as usize;
        let moved = MovedTree::new(self.store, place.base().unwrap_or_default());
        contour(&moved, &ContourOptions { cache_bytes, ..ContourOptions::default() }, mesh, bars)?;
        Ok(())
    }

    /// How far points of the reference are from it, and their file, if one was asked for: of a cloud all points then.
    fn back(
        &self,
        opened: &OpenReference,
        (reference, motion): (Reference<'_>, Motion),
        file: Option<PartFile>,
        bars: &Bars,
    ) -> Result<(PointNumbers, Option<ScalarPoints>), Failure> {
        let points = match opened.points().filter(|_| file.is_some()) {
            Some(all) => Cow::Borrowed(all),
            None => Cow::Owned(reference.samples(POINTS_BACK)),
        };
        let file = file.map(|file| ScalarPoints::new(file, "deviation", points.len()));
        let mut file = file.transpose()?;
        let number = |last: &mut PreviousPlace, point| {
            Ok(of_surface(&self.surface, &self.sides, motion.undo(point), last)?.signed)
        };
        let numbers = at_points(&points, waiting(self.args), bars, number, |points, numbers| {
            file.as_mut().map_or(Ok(()), |file| file.append(points, numbers))
        })?;
        Ok((numbers, file))
    }
}

/// Refuses a name of points with numbers that does not end in .ply.
fn require_ply(path: &Path) -> Result<(), Failure> {
    if ends_in(path, &["ply"]) {
        return Ok(());
    }
    Err(Failure::Usage(format!(
        "{}: the name must end in .ply, the format of points with numbers",
        in_line(path)
    )))
}

/// Tells of a part that lies elsewhere on the bed.
fn tell_shift(args: &DeviationArgs, part: [[f64; 3]; 2], reference: [[f64; 3]; 2], unit: &str) {
    let (own, others) = (sizes(part), sizes(reference));
    let size = own.iter().copied().fold(0.0, f64::max);
    let shift: [f64; 3] =
        std::array::from_fn(|a| 0.5 * (reference[0][a] + reference[1][a] - part[0][a] - part[1][a]));
    let is_alike = (0..3).all(|a| (own[a] - others[a]).abs() < SHIFTED * size);
    let is_shifted = shift.iter().any(|s| s.abs() > SHIFTED * size);
    if is_alike && is_shifted && args.align == AlignArg::None && !args.work.quiet {
        let shift = point_text(shift);
        note(&format!(
            "the boxes have one size and differ by a shift of {shift} {unit}; --align shift takes it away"
        ));
    }
}

fn spread(spread: &Spread, cell: f64) -> Value {
    let length = |value: f64| to_place(value, cell / 1e4);
    let by_share = |shares: &[f64], values: &[f64]| -> serde_json::Map<String, Value> {
        shares.iter().zip(values).map(|(share, &value)| (share.to_string(), length(value))).collect()
    };
    json!({
        "points": spread.points,
        "mean": length(spread.mean),
        "rms": length(spread.rms),
        "min": length(spread.min),
        "percentiles": by_share(&PERCENTILES, &spread.percentiles),
        "max": length(spread.max),
        "percentiles_abs": by_share(&ABSOLUTE_PERCENTILES, &spread.absolute),
        "max_abs": length(spread.largest()),
    })
}

fn table(store: &Store, sides: &[Vec<Region>; 2], cell: f64) -> Result<Table<'static>, Failure> {
    let layers = layers_of(store, &sides.iter().flatten().collect::<Vec<_>>())?;
    let length = |value: f64| to_place(value, cell / 1000.0);
    let mut rows = Vec::new();
    for (side, regions) in ["over", "under"].into_iter().zip(sides) {
        for region in regions {
            let mut cells = vec![
                json!(rows.len() + 1),
                json!(side),
                to_place(region.area, region.area / 1e4),
                to_place(region.volume, region.volume / 1e4),
                length(region.greatest),
                length(region.mean),
            ];
            cells.extend(region.centre.map(|c| to_place(c, cell / 100.0)));
            cells.extend(layers[rows.len()].clone());
            rows.push(cells);
        }
    }
    Ok(Table::of_rows(&COLUMNS, rows))
}

impl Comparison {
    /// Vertices where no points were measured.
    fn without(&self) -> u64 {
        self.counts.0 - self.there.points as u64
    }

    fn document(&self, args: &DeviationArgs, store: &Store, kind: &str, place: &MeshPlace) -> Value {
        let cell = store.root().spacing(store.meta().depth);
        let method = match self.how {
            Align::No => "none",
            Align::Shift => "shift",
            Align::Rigid => "icp",
        };
        let mut document = json!({
            "unit": store.meta().unit,
            "cell": cell,
            "reference": args.reference.display().to_string(),
            "reference_is": kind,
            "vertices": self.counts.0,
            "vertices_without_points": self.without(),
            "triangles": self.counts.1,
            "origin": place.origin(),
            "coordinate_bits": place.bits(),
            "align": {
                "method": method,
                "shift": self.motion.shift,
                "rotation": self.motion.rotation,
                "degrees": self.motion.degrees(),
                "residual": to_place(self.residual, cell / 1e4),
            },
            "part_to_reference": spread(&self.there, cell),
            "reference_to_part": spread(&self.back, cell),
        });
        if let Some((within, vertices)) = self.beyond {
            document["within"] = json!(within);
            document["vertices_beyond"] = json!(vertices);
        }
        document
    }

    /// Tells if nothing of the part was measured.
    fn tell_if_apart(&self, args: &DeviationArgs) {
        if self.there.points == 0 {
            let what = "no vertex of the part lies where points were measured; are both in one place? --align icp moves it";
            warn(&format!("{}: {what}", in_line(&args.reference)));
        }
    }

    /// Fails if a deviation is above what is allowed.
    fn require_within(&self, args: &DeviationArgs, cell: f64) -> Result<(), Failure> {
        let largest = self.there.largest().max(self.back.largest());
        match self.beyond.filter(|(within, _)| largest > *within) {
            Some((within, _)) => {
                let (name, largest) = (in_line(&args.store), to_place(largest, cell / 1000.0));
                Err(anyhow!("{name}: the largest deviation {largest} is above --within {within}").into())
            }
            None => Ok(()),
        }
    }

    /// What is found, for people.
    fn summary(&self, args: &DeviationArgs, store: &Store, regions: Option<&[Vec<Region>; 2]>) -> String {
        let Comparison { there, back, motion, .. } = self;
        let unit = unit_of(store.meta());
        let cell = store.root().spacing(store.meta().depth);
        let length = |value: f64| to_place(value, cell / 1000.0);
        let line = |spread: &Spread| {
            format!(
                "{} to {} {unit}, rms {}, 95 % within ±{}, 98 % within {} to {}",
                length(spread.min),
                length(spread.max),
                length(spread.rms),
                length(spread.absolute[1]),
                length(spread.percentiles[1]),
                length(spread.percentiles[3])
            )
        };
        let mut text = format!(
            "{}: {} vertices; deviation {}\nback from {} points of the reference {}",
            in_line(&args.output),
            there.points,
            line(there),
            back.points,
            line(back)
        );
        if self.how != Align::No {
            let [x, y, z] = motion.shift.map(length);
            let turned = if self.how == Align::Rigid {
                format!("turned by {:.4}° and ", motion.degrees())
            } else {
                String::new()
            };
            text +=
                &format!("\n{turned}shifted by ({x}, {y}, {z}) {unit}; residual {}", length(self.residual));
        }
        let without = self.without();
        if without > 0 {
            text += &format!("\n{without} vertices have no number: no points were measured there");
        }
        if let Some([over, under]) = regions {
            text += &format!("\n{} regions over, {} under", over.len(), under.len());
        }
        text
    }
}
