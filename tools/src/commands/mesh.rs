//! `brickfield mesh`: a level set of the field as a mesh file.

use super::mesh_check::{CheckOutcome, require_sound};
use super::mesh_close::{ClosedStore, MeshClosing};
use super::mesh_detail::{self, MeshDetail};
use super::mesh_place::{self, MeshPlace, PlaceWish};
use super::mesh_quality::{self, Quality};
use super::mesh_shells::{self, ShellChoice, Shells};
use super::{of_store, open_store, require_level, start};
use crate::args::{MeshArgs, MethodArg, OriginArg};
use crate::elsewhere::is_address;
use crate::failure::Failure;
use crate::kinds::{is_mesh_name, mesh_formats, not_a_store};
use crate::measured::measured;
use crate::memory;
use crate::output::{note, one_line, print, print_json, require_distinct, warn};
use crate::pieces::{negative, negative_text};
use crate::progress::Bars;
use crate::space::{LARGE_BYTES, require_space, tell_left_behind};
use crate::units::{Size, Tolerance, Unit};
use brickfield_engine::analysis::{Volumes, volume};
use brickfield_engine::contour::{
    Angles, ContourMethod, ContourOptions, Coordinates, KeptCounts, MeshSink, MeshSummary, PlacedSink,
    ShellFilter, contour, create_sink, create_sink_with_normals, foresee_triangles,
};
use brickfield_engine::part::free_beside;
use brickfield_engine::store::{AcceptedStores, BrickTree, CacheStats, MovedTree, Store, is_store};
use brickfield_engine::{Error, Progress};
use serde::Serialize;
use std::path::Path;
use std::time::Instant;

/// Most for decoded bricks, some sixty.
const BRICK_CACHE_BYTES: u64 = 8 << 20;

/// The winding number at the boundary.
pub(super) const BOUNDARY: f64 = 0.5;

/// Runs the command.
pub fn run(args: MeshArgs) -> Result<(), Failure> {
    if let Some(output) = args.output.as_ref().filter(|output| super::mesh_tiles::is_tileset(output)) {
        return super::mesh_tiles::run(&args, output);
    }
    let iso = args.iso.unwrap_or(BOUNDARY);
    if !(iso > 0.0 && iso <= f64::from(i16::MAX)) {
        let what = "surfaces are where w rises above a number greater than 0, such as 0.5 or 1.5";
        return Err(Failure::Usage(format!("--iso {iso}: {what}")));
    }
    let is_coarse = mesh_detail::is_asked(&args);
    if is_coarse {
        mesh_detail::check(&args)?;
    }
    mesh_shells::check(&args)?;
    if args.close.is_some() && !is_coarse && iso != BOUNDARY {
        return Err(Failure::Usage(format!("--iso {iso}: --close is of the boundary, where w = 0.5")));
    }
    if let Some(output) = args.output.as_ref().filter(|output| args.check && !is_mesh_name(output)) {
        let what = format!("--check reads {}; write one of these", mesh_formats());
        return Err(Failure::Usage(format!("{}: {what}", output.display())));
    }
    let bars = start(args.work)?;
    let Some(output) = &args.output else { return super::mesh_check::run(&args, &bars) };
    let store = match is_address(&args.file) || is_store(&args.file) {
        true => open_store(&args.file, 0, args.io, AcceptedStores::Whole),
        // Meshes are checked by this command, too.
        false => {
            Store::open(&args.file, 0).map_err(|error| not_a_store(&args.file, error, Some("mesh --check")))
        }
    }?;
    // The contourer keeps what it makes of bricks and asks the store for each about once.
    let cache_bytes = memory::mesh_caches(args.memory, &store);
    let brick_bytes = (cache_bytes / 8).min(BRICK_CACHE_BYTES);
    let store = store.with_cache(brick_bytes);
    if let Some(level) = args.level {
        require_level(&store, level)?;
    }
    require_distinct(&[output], &[&args.file])?;
    tell_left_behind(output, args.work.quiet);
    let (double, single) = (args.double, args.normals);
    let wish = PlaceWish { double, origin: args.origin, single, ..PlaceWish::default() };
    let place = MeshPlace::of(wish, &store, output)?;
    let mut sink = match mesh_place::sink(&args, &store, output, place)? {
        Some(sink) => sink,
        None => mesh_sink(output, Unit::of_symbol(&store.meta().unit), args.normals)?,
    };
    let started = Instant::now();
    let closed = args.close.map(|length| ClosedStore::of(&store, length, output, cache_bytes, &bars));
    let closed = closed.transpose()?;
    let closing = closed.as_ref().map(|closed| closed.told);
    let store = closed.as_ref().map_or(&store, |closed| &closed.store);
    if args.tolerance.in_unit(Unit::Mm) == 0.0 && !is_coarse {
        require_mesh_space(store, output, (iso, args.level), args.work.quiet)?;
    }
    let moved = MovedTree::new(store, place.base().unwrap_or_default());
    let tree: &dyn BrickTree = if place == MeshPlace::World { store } else { &moved };
    if is_coarse {
        return run_coarse(
            (&args, closing, started),
            (store, tree, place),
            (output, sink.as_mut()),
            (cache_bytes, brick_bytes),
            &bars,
        );
    }
    let options = ContourOptions {
        iso,
        level: args.level,
        cache_bytes: (cache_bytes - brick_bytes) as usize,
        tolerance: tolerance_in(args.tolerance, store)?,
        intersection_free: args.intersection_free,
        method: args.method.into(),
        follow_creases: args.follow_creases,
        temp_dir: args.temp_dir.clone(),
    };
    let mut report = if mesh_shells::is_asked(&args) {
        write_shells(&args, (store, tree), &options, (output, sink.as_mut()), cache_bytes / 2, &bars)?
    } else {
        let mut report = write_tree(store, tree, &options, output, sink.as_mut(), &bars)?;
        report.compare(store, &options, &bars)?;
        report
    };
    report.place(place);
    if closing.is_some() {
        (report.closing, report.seconds) = (closing, started.elapsed().as_secs_f64());
    }
    drop(sink);
    place.tell(store, output)?;
    finish(&args, store, output, report, &bars)
}

/// Writes a mesh of the fractions of solid in coarse cells.
fn run_coarse(
    (args, closing, started): (&MeshArgs, Option<MeshClosing>, Instant),
    (store, whole, place): (&Store, &dyn BrickTree, MeshPlace),
    (output, sink): (&Path, &mut dyn MeshSink),
    (cache_bytes, brick_bytes): (u64, u64),
    bars: &Bars,
) -> Result<(), Failure> {
    // Fractions take what contouring leaves.
    let options = mesh_detail::options_of(args, store, (cache_bytes / 4) as usize)?;
    let memory = cache_bytes - cache_bytes / 4 - brick_bytes;
    let source = if store.meta().shard.is_none() { Some(ExpectedVolume::of(store, bars)?) } else { None };
    let (of, with) = ((output, place.bits()), (&options, memory));
    let (made, chosen) = mesh_detail::find_chosen(args, (store, whole), of, with, source.as_ref(), bars)?;
    let options = ContourOptions { tolerance: made.tolerance, ..options };
    let tree = made.tree(whole);
    let mut report = write_chosen((args, &chosen), (store, tree.as_tree()), &options, (output, sink), bars)?;
    let mut detail = MeshDetail::of(&made, store, bars)?;
    detail.measure(&made, (&options, memory), (store, whole), bars)?;
    report.place(place);
    place.tell(store, output)?;
    let unit = &report.unit;
    if let Some(expected) = source {
        if args.iso.is_none()
            && let Some(lost) = mesh_detail::lost_volume(args, &made, &expected, unit)
        {
            warn(&format!("{}: {lost}", report.output));
        }
        report.expected = Some(expected);
    }
    let most = mesh_detail::most_triangles(args, of)?;
    if args.detail.is_none()
        && let Some(why) = mesh_detail::fewer_triangles(args, &made, report.triangles, most)
    {
        warn(&format!("{}: {why}", report.output));
    }
    report.iso = made.kept.fraction;
    report.cell = made.cell();
    report.detail = Some(detail);
    report.closing = closing;
    report.seconds = started.elapsed().as_secs_f64();
    finish(args, store, output, report, bars)
}

/// Contours a tree that was made of the store, without the shells that are not wanted.
fn write_shells(
    args: &MeshArgs,
    (store, tree): (&Store, &dyn BrickTree),
    options: &ContourOptions,
    (output, sink): (&Path, &mut dyn MeshSink),
    memory: u64,
    bars: &Bars,
) -> Result<MeshReport, Failure> {
    let chosen = mesh_shells::choose(args, tree, options, memory, bars)
        .map_err(|error| of_store(store, "shells", error))?;
    write_chosen((args, &chosen), (store, tree), options, (output, sink), bars)
}

/// Contours a tree that was made of the store into the shells that are kept.
fn write_chosen(
    (args, chosen): (&MeshArgs, &ShellChoice),
    (store, tree): (&Store, &dyn BrickTree),
    options: &ContourOptions,
    (output, sink): (&Path, &mut dyn MeshSink),
    bars: &Bars,
) -> Result<MeshReport, Failure> {
    if !chosen.kept.is_empty() && !chosen.kept.contains(&true) {
        let (path, count) = (store.path().display(), chosen.kept.len());
        let what = format!("{path}: none of {count} shells is left; choose a smaller --min-shell-volume");
        return Err(anyhow::anyhow!(what).into());
    }
    if args.quality {
        return mesh_quality::write_improved(chosen, (store, tree), options, (output, sink), bars);
    }
    Ok(write_kept(chosen, (store, tree), options, (output, sink), bars)?.0)
}

/// Contours a tree into the shells that are kept; returns the angles of their triangles, too.
pub fn write_kept(
    chosen: &ShellChoice,
    (store, tree): (&Store, &dyn BrickTree),
    options: &ContourOptions,
    (output, sink): (&Path, &mut dyn MeshSink),
    bars: &Bars,
) -> Result<(MeshReport, Angles), Failure> {
    let mut some = ShellFilter::new(sink, &chosen.kept, &chosen.of);
    let mut report = write_tree(store, tree, options, output, &mut some, bars)?;
    if chosen.kept.contains(&false) {
        report.count(&some.counted(), chosen.told.pieces.volume - chosen.told.voids.volume);
    }
    report.shells = Some(chosen.told);
    let angles = some.counted().angles;
    Ok((report, angles))
}

/// Checks what was written, and tells of it.
fn finish(
    args: &MeshArgs,
    store: &Store,
    output: &Path,
    mut report: MeshReport,
    bars: &Bars,
) -> Result<(), Failure> {
    let negative = negative(store, bars)?;
    report.negative_volume = negative.map(|(volume, _)| volume);
    report.negative_volume_error = negative.map(|(_, error)| error);
    // An empty mesh is what the field asks for, and there is nothing to check.
    if args.check && report.triangles > 0 {
        report.check = Some(CheckOutcome::of(output, args.weld, args.memory, bars)?);
    }
    bars.clear();
    if let Some(negative) = negative {
        warn(&format!("{}: {}", args.file.display(), negative_text(negative, &report.unit)));
    }
    if args.json {
        print_json(&report)?;
    } else if !args.work.quiet {
        print(&report.text())?;
    }
    report.check.as_ref().map_or(Ok(()), require_sound)
}

impl From<MethodArg> for ContourMethod {
    fn from(method: MethodArg) -> ContourMethod {
        match method {
            MethodArg::Dual => ContourMethod::Dual,
            MethodArg::Mc => ContourMethod::MarchingCubes,
        }
    }
}

/// The tolerance in the store's unit.
pub fn tolerance_in(tolerance: Tolerance, store: &Store) -> Result<f64, Failure> {
    tolerance.in_unit_of(&store.meta().unit).ok_or_else(|| {
        Failure::Usage("the store has no unit of length; give --tolerance as a number alone".to_owned())
    })
}

/// Most triangles of a brick: those of its cells that a surface along a face passes, for the way in which beads fill bricks
/// three times over.
const TRIANGLES_A_BRICK: u64 = 3 * 2 * 32 * 32;

/// Bytes of a mesh file for each triangle, of which there are two for each vertex.
pub fn bytes_a_triangle(path: &Path) -> u64 {
    let ending = path.extension().map(|ending| ending.to_string_lossy().to_ascii_lowercase());
    match ending.as_deref() {
        Some("stl") => 50,
        Some("obj") => 45,
        Some("3mf") => 12,
        Some("vtp") => 38,
        // Binary PLY and GLB.
        _ => 19,
    }
}

/// Smaller meshes are written before anyone could read how large they will be.
const TOLD_BYTES: u64 = 10_000_000;

/// Tells how large a mesh without a tolerance will be, warns of one of more than a gigabyte, and fails if its disk has no room
/// for it.
///
/// # Errors
/// Size and room; what reading the store gives.
pub fn require_mesh_space(
    store: &Store,
    path: &Path,
    (iso, level): (f64, Option<u8>),
    quiet: bool,
) -> Result<(), Failure> {
    let a_triangle = bytes_a_triangle(path);
    let bricks = store.entries().iter().filter(|entry| !entry.head.kind.is_uniform()).count() as u64;
    let most = bricks.saturating_mul(TRIANGLES_A_BRICK * a_triangle);
    // Nothing is read where it cannot matter.
    if most < TOLD_BYTES {
        return Ok(());
    }
    let triangles = foresee_triangles(store, iso, level)?;
    let bytes = triangles.saturating_mul(a_triangle);
    require_space(path, bytes, SMALLER)?;
    if quiet || bytes < TOLD_BYTES {
        return Ok(());
    }
    let free = free_beside(path).map_or(String::new(), |free| format!(", {} free there", Size(free)));
    let millions = triangles as f64 / 1e6;
    let told = format!("{}: about {millions:.1} million triangles, {}{free}", path.display(), Size(bytes));
    if bytes > LARGE_BYTES {
        warn(&format!("{told}; {SMALLER}"));
    } else {
        note(&told);
    }
    Ok(())
}

/// What makes a mesh smaller.
const SMALLER: &str = "use --triangles 1000000, --max-size 200MB or --detail LEN, which keep the volume";

/// The file for a mesh in this unit, with normals or not; a name whose format is unknown or has none is wrong usage.
pub fn mesh_sink(path: &Path, unit: Option<Unit>, normals: bool) -> Result<Box<dyn MeshSink>, Failure> {
    if path.is_dir() {
        return Err(
            anyhow::anyhow!("{}: this is a directory; give the mesh a name in it", path.display()).into()
        );
    }
    let create = if normals { create_sink_with_normals } else { create_sink };
    create(path, unit.map(Unit::metres)).map_err(|error| match error {
        Error::Setting { .. } => Failure::Usage(error.to_string()),
        error => error.into(),
    })
}

/// Lower and upper corner of a mesh, with as many digits as its coordinates have.
#[derive(Serialize)]
#[serde(untagged)]
enum MeshBounds {
    Single([[f32; 3]; 2]),
    Double([[f64; 3]; 2]),
}

impl MeshBounds {
    /// Added to a position of the world.
    fn moved(self, place: [f64; 3]) -> MeshBounds {
        match self {
            MeshBounds::Single(ends) => {
                MeshBounds::Double(ends.map(|end| std::array::from_fn(|a| place[a] + f64::from(end[a]))))
            }
            moved @ MeshBounds::Double(_) => moved,
        }
    }
}

/// What was written.
#[derive(Serialize)]
pub struct MeshReport {
    output: String,
    unit: String,
    iso: f64,
    vertices: u64,
    pub(super) triangles: u64,
    area: f64,
    volume: f64,
    bounds: Option<MeshBounds>,
    coordinate_bits: u8,
    /// What is to be added to the file's coordinates.
    #[serde(skip_serializing_if = "Option::is_none")]
    origin: Option<[f64; 3]>,
    brick_cache: BrickCache,
    seconds: f64,
    /// What the volume should be, where that is known.
    expected: Option<ExpectedVolume>,
    /// Edge of the largest cells that the boundary passes; 0 where nothing is expected.
    #[serde(skip)]
    cell: f64,
    /// What was filled before, if that was asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    closing: Option<MeshClosing>,
    /// Of a mesh of fractions.
    #[serde(skip_serializing_if = "Option::is_none")]
    detail: Option<MeshDetail>,
    /// What was kept and left out, where shells were told apart.
    #[serde(skip_serializing_if = "Option::is_none")]
    shells: Option<Shells>,
    /// The angles of triangles, if they were asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) quality: Option<Quality>,
    /// Where w is negative, though the meshes are closed.
    #[serde(skip_serializing_if = "Option::is_none")]
    negative_volume: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    negative_volume_error: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    check: Option<CheckOutcome>,
}

/// The volume of the union.
#[derive(Serialize)]
pub struct ExpectedVolume {
    /// Whose: "source", or "samples", by chords between their crossings.
    whose: &'static str,
    pub volume: f64,
    /// Bound on its error.
    pub error: f64,
}

impl ExpectedVolume {
    /// Of a whole store: the source's, which the store knows where that was closed, or else by the store's own chords.
    fn of(store: &Store, progress: &dyn Progress) -> Result<ExpectedVolume, Failure> {
        let (whose, volumes) = match &store.meta().volumes {
            Some(source) => ("source", Volumes::from(source)),
            None => ("samples", volume(store, progress)?),
        };
        Ok(ExpectedVolume { whose, volume: volumes.union, error: volumes.union_error })
    }
}

/// How often the store's decoded bricks were asked for again; and how many records the system was asked for ahead of
/// their reading, and how many of these were read.
#[derive(Serialize)]
struct BrickCache {
    hits: u64,
    misses: u64,
    ahead: u64,
    ahead_used: u64,
}

impl MeshReport {
    /// Takes the counts of a mesh of which this is written.
    pub(super) fn count(&mut self, counted: &KeptCounts, volume: f64) {
        (self.vertices, self.triangles) = (counted.vertices, counted.triangles);
        (self.area, self.volume) = (counted.area, volume);
        self.bounds = counted.bounds.map(MeshBounds::Single);
    }

    /// Of a mesh that was made elsewhere: its bounds are those in the store's world.
    pub(super) fn place(&mut self, place: MeshPlace) {
        let Some(base) = place.base() else { return };
        self.bounds = self.bounds.take().map(|bounds| bounds.moved(base));
        self.origin = place.origin();
        self.coordinate_bits = place.bits();
    }

    /// Compares the mesh's volume with that of the source, which the store knows where that was closed, or else with
    /// that of the store's own chords; and warns if they are farther apart than what cells can hide. Only of the boundary of
    /// a whole store at its finest.
    pub fn compare(
        &mut self,
        store: &Store,
        options: &ContourOptions,
        progress: &dyn Progress,
    ) -> Result<(), Failure> {
        if options.iso != 0.5 || options.level.is_some() || store.meta().shard.is_some() {
            return Ok(());
        }
        let expected = ExpectedVolume::of(store, progress)?;
        let whose = expected.whose;
        // The mesh may cut off half a cell all over the boundary.
        let crossed = store.entries().iter().filter(|entry| entry.leaf && !entry.head.kind.is_uniform());
        let cell = crossed.map(|entry| store.meta().root.spacing(entry.key.level())).fold(0.0, f64::max);
        let error = (0.5 * cell + options.tolerance) * self.area + expected.error;
        if (self.volume - expected.volume).abs() > error {
            let (mesh, unit) = (self.volume, &self.unit);
            let there = measured(expected.volume, expected.error);
            warn(&format!(
                "{}: the mesh holds {mesh:.3} {unit}³ and the {whose} {there} {unit}³, farther apart than their errors: walls \
                 or gaps are thinner than a cell; build with --max-depth or a greater --depth",
                self.output
            ));
        }
        self.cell = cell;
        self.expected = Some(expected);
        Ok(())
    }

    /// For people.
    pub fn text(&self) -> String {
        let MeshReport { unit, vertices, triangles, area, volume, seconds, .. } = self;
        let output = one_line(&self.output);
        if *triangles == 0 {
            return format!("{output}: empty, no sample reaches w = {}", self.iso);
        }
        let mut text = format!(
            "{output}: {triangles} triangles, {vertices} vertices, area {area:.6} {unit}², volume {volume:.6} \
             {unit}³, {seconds:.2} s"
        );
        if let Some(line) = self.origin.and_then(|origin| MeshPlace::Shifted(origin).line(unit)) {
            text += &format!("\n  origin   {line}");
        }
        text.extend(self.closing.iter().map(|closing| closing.text(unit)));
        text.extend(self.expected_text());
        let shells = self.shells.unwrap_or_default();
        text.extend(self.detail.iter().map(|detail| detail.text(&shells, unit)));
        text.extend(shells.text(unit));
        text.extend(self.quality.iter().map(|quality| quality.text(unit)));
        if let Some(check) = &self.check {
            text += &format!("\n{}", check.text());
        }
        text
    }
}

impl MeshReport {
    /// The volume that should be, and why the mesh's is another.
    fn expected_text(&self) -> Option<String> {
        let ExpectedVolume { whose, volume, error } = self.expected.as_ref()?;
        let (unit, cell) = (&self.unit, self.cell);
        let verb = if *whose == "samples" { "hold" } else { "holds" };
        let mut text = format!("\n  volume   the {whose} {verb} {} {unit}³", measured(*volume, *error));
        let off = self.volume - volume;
        if off.abs() > error.max(5e-5 * volume) {
            let percent = 100.0 * off.abs() / volume;
            let more = if off > 0.0 { "more" } else { "less" };
            text += &format!("; the mesh {percent:.2}% {more}");
            text += &match self.shells {
                Some(shells) if shells.has_dropped() => ", with what is left out".to_owned(),
                _ => format!(", as cells of {cell:.6} {unit} round off what is smaller"),
            };
        }
        Some(text)
    }
}

/// Contours the store into `sink`, which was made for `path`, or into another file of that name where coordinates need
/// 64 bits.
pub fn write_mesh(
    store: &Store,
    options: &ContourOptions,
    path: &Path,
    (mut sink, origin): (Box<dyn MeshSink>, Option<OriginArg>),
    progress: &dyn Progress,
) -> Result<MeshReport, Failure> {
    let place = MeshPlace::of(PlaceWish { origin, ..PlaceWish::default() }, store, path)?;
    if place.coordinates() != Coordinates::Single {
        drop(sink);
        sink = Box::new(PlacedSink::create(path, place.coordinates(), None)?);
    }
    let moved = MovedTree::new(store, place.base().unwrap_or_default());
    let tree: &dyn BrickTree = if place == MeshPlace::World { store } else { &moved };
    let mut report = write_tree(store, tree, options, path, sink.as_mut(), progress)?;
    report.place(place);
    place.tell(store, path)?;
    Ok(report)
}

/// Contours a tree that was made of the store.
fn write_tree(
    store: &Store,
    tree: &dyn BrickTree,
    options: &ContourOptions,
    path: &Path,
    sink: &mut dyn MeshSink,
    progress: &dyn Progress,
) -> Result<MeshReport, Failure> {
    let started = Instant::now();
    let MeshSummary { vertices, triangles, area, volume, bounds, unseparated_cells, .. } =
        contour(tree, options, sink, progress).map_err(|error| of_store(store, "settings", error))?;
    if unseparated_cells > 0 {
        warn(&format!(
            "{}: triangles may meet in {unseparated_cells} cells next to finer bricks (mesh --check counts them)",
            path.display()
        ));
    }
    let CacheStats { hits, misses, ahead, ahead_used, .. } = store.cache_stats();
    Ok(MeshReport {
        output: path.display().to_string(),
        unit: super::unit_of(store.meta()).to_owned(),
        iso: options.iso,
        vertices,
        triangles,
        area,
        volume,
        bounds: bounds.map(MeshBounds::Single),
        coordinate_bits: 32,
        origin: None,
        brick_cache: BrickCache { hits, misses, ahead, ahead_used },
        seconds: started.elapsed().as_secs_f64(),
        expected: None,
        cell: 0.0,
        closing: None,
        detail: None,
        shells: None,
        quality: None,
        negative_volume: None,
        negative_volume_error: None,
        check: None,
    })
}
