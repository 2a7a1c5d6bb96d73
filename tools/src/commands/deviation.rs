//! `brickfield deviation`: a part against what it should be.

use super::deviation_tables::BeadTableFiles;
use super::mesh_place::{MeshPlace, ends_in};
use super::reference::{Compared, open_reference, point_text, require_alike, sizes};
use super::thickness::{layers_of, place_of, require_numbers};
use super::{no_unit, of_store, open_store, require_whole_samples, start, unit_of};
use crate::distance_args::{AlignArg, DeviationArgs};
use crate::failure::Failure;
use crate::output::{in_line, note, print, print_json, require_distinct, warn};
use crate::table::{Table, TableKind, to_place};
use crate::units::Unit;
use anyhow::anyhow;
use brickfield_engine::contour::{ContourOptions, contour};
use brickfield_engine::distance::deviation::{
    ABSOLUTE_PERCENTILES, Motion, PERCENTILES, Spread, at_points, of_surface, regions_beyond,
};
use brickfield_engine::distance::{
    ALIGNED_POINTS, Align, PreviousPlace, Region, ScalarMesh, ScalarPoints, Sides, Surface, align,
    deviation_by_bead,
};
use brickfield_engine::part::{PartFile, directory_of};
use brickfield_engine::store::{AcceptedStores, BrickTree, MovedTree, Store};
use serde_json::{Value, json};
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
}

/// Runs the command.
pub fn run(args: &DeviationArgs) -> Result<(), Failure> {
    require_numbers(&args.output)?;
    args.reference_points.as_deref().map(require_ply).transpose()?;
    let kind = args.regions.as_deref().map(TableKind::of).transpose()?;
    let by_bead = BeadTableFiles::new(args)?;
    let bars = start(args.work)?;
    let store = open_store(&args.store, args.memory.0 / 8, args.io, AcceptedStores::Whole)?;
    let mut outputs: Vec<&Path> = vec![&args.output];
    let tables = args.regions.iter().chain(&args.layers).chain(&args.features);
    outputs.extend(tables.chain(&args.reference_points).map(PathBuf::as_path));
    require_distinct(&outputs, &[&args.store, &args.reference])?;
    require_whole_samples(&store, "its deviation cannot be told")?;
    let unit = store.meta().unit.clone();
    let within = args.within.map(|length| length.in_unit_of(&unit).ok_or_else(no_unit)).transpose()?;
    let bead_tables = by_bead.tables_of(&store)?;
    let table_file = args.regions.as_deref().map(PartFile::create).transpose()?;
    let by_bead = by_bead.create()?;
    let points_file = args.reference_points.as_deref().map(PartFile::create).transpose()?;
    let folder = args.temp_dir.as_deref().unwrap_or(directory_of(&args.output));
    let waiting = (args.memory.0 / 8, folder);
    let metres = Unit::of_symbol(&unit).map(Unit::metres);
    let place = place_of(&store, &args.output, args.origin)?;
    let from = (place.base().unwrap_or_default(), place.coordinates());
    let mut ply = ScalarMesh::new(PartFile::create(&args.output)?, "deviation", metres, from, waiting)?;
    let compared = Compared {
        reference: &args.reference,
        output: &args.output,
        folder,
        memory: args.memory.0,
        io: args.io,
        align: args.align,
    };
    let opened = open_reference(&compared, &store, &bars)?;
    let sides_of_reference = opened.sides()?;
    let surface = Surface::new(&store, args.memory.0 / 4, folder, &bars)
        .map_err(|error| of_store(&store, "surface", error))?;
    let sides = Sides::new(&store)?;
    let cell = surface.cell();
    let Some(bounds) = surface.bounds() else {
        return Err(
            anyhow!("{}: the store has no surface; build it with finer cells", in_line(&args.store)).into()
        );
    };
    let beside = (&surface, &sides);
    let reference = opened.reference(sides_of_reference.as_ref(), beside, Motion::NONE);
    require_alike(&compared, bounds, reference)?;
    let contouring =
        ContourOptions { cache_bytes: (args.memory.0 / 4) as usize, ..ContourOptions::default() };
    let moved = MovedTree::new(&store, place.base().unwrap_or_default());
    contour(&moved, &contouring, &mut ply, &bars)?;
    let counts = ply.counts();
    let how = Align::from(args.align);
    let (motion, residual) = align(&ply.some_positions(ALIGNED_POINTS), bounds, reference, how)?;
    let reference = opened.reference(sides_of_reference.as_ref(), beside, motion);
    let values = ply.fill(&bars, |last: &mut PreviousPlace, world| {
        Ok(reference.opposite_next(motion.apply(world), last)?.signed as f32)
    })?;
    let some: Vec<[f64; 3]>;
    let points = match opened.points().filter(|_| points_file.is_some()) {
        Some(all) => all,
        None => {
            some = reference.samples(POINTS_BACK);
            &some
        }
    };
    let mut written =
        points_file.map(|file| ScalarPoints::new(file, "deviation", points.len())).transpose()?;
    let from_part =
        |last: &mut PreviousPlace, point| Ok(of_surface(&surface, &sides, motion.undo(point), last)?.signed);
    let back = at_points(points, waiting, &bars, from_part, |points, numbers| {
        written.as_mut().map_or(Ok(()), |file| file.append(points, numbers))
    })?;
    let regions = match (within, kind) {
        (Some(within), Some(_)) => Some(regions_beyond(&surface, reference, (motion, within), &bars)?),
        _ => None,
    };
    let found = bead_tables
        .as_ref()
        .map(|tables| deviation_by_bead((&store, tables), &surface, (reference, motion), &bars))
        .transpose()?;
    let [there, back] = [Spread::of(&values), Spread::of(&back)];
    let comparison = Comparison { there, back, counts, how, motion, residual };
    if there.points == 0 {
        let what = "no vertex of the part lies where points were measured; are both in one place? --align icp moves it";
        warn(&format!("{}: {what}", in_line(&args.reference)));
    }
    let table = regions.as_ref().map(|regions| table(&store, regions, cell)).transpose()?;
    let mut document = comparison.document(args, &store, opened.kind(), &place);
    if let Some(within) = within {
        let beyond = values.iter().filter(|value| value.abs() > within).count();
        document["within"] = json!(within);
        document["vertices_beyond"] = json!(beyond);
    }
    if let Some(table) = &table {
        document["regions"] = table.objects();
    }
    let by_bead = found.zip(bead_tables).map(|(found, tables)| by_bead.filled((&found, &tables), cell));
    by_bead.iter().flatten().for_each(|(name, table, ..)| document[name] = table.objects());
    bars.clear();
    ply.complete()?;
    written.as_mut().map(ScalarPoints::complete).transpose()?;
    place.tell(&store, &args.output)?;
    if let (Some(mut file), Some(kind), Some(table)) = (table_file, kind, &table) {
        table.append_to(&mut file, kind, &document)?;
        file.finish()?;
    }
    for (_, table, mut file, kind) in by_bead.into_iter().flatten() {
        table.append_to(&mut file, kind, &document)?;
        file.finish()?;
    }
    if args.json {
        print_json(&document)?;
    } else if !args.work.quiet {
        let mut text = comparison.summary(args, &store, regions.as_ref());
        text.extend(place.line(unit_of(store.meta())).map(|line| format!("\norigin {line}")));
        print(&text)?;
    }
    tell_shift(args, bounds, reference.bounds(), unit_of(store.meta()));
    let largest = there.largest().max(back.largest());
    if let Some(within) = within.filter(|within| largest > *within) {
        let name = in_line(&args.store);
        let largest = to_place(largest, cell / 1000.0);
        return Err(anyhow!("{name}: the largest deviation {largest} is above --within {within}").into());
    }
    Ok(())
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
        json!({
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
        })
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
