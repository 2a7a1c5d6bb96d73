//! `brickfield machine`: what tools take off a part.

use super::csg::{pace, text as csg_text};
use super::operands::source_of;
use super::{open_store, require_whole_samples, start, unit_of};
use crate::failure::Failure;
use crate::kinds::require_store_name;
use crate::machine_args::{MachineArgs, NumberedRadius, NumberedTool};
use crate::measured::measured;
use crate::output::{in_line, print, print_json, require_distinct, warn};
use crate::progress::Bars;
use crate::table::{Table, TableKind, to_place};
use anyhow::{Context, anyhow};
use brickfield_engine::csg::{Chain, CsgSummary, Operand, Operation, SweptBricks, Writing, meta_of};
use brickfield_engine::lattice::millimetres;
use brickfield_engine::machining::{
    BoundedVolume, Cut, OpenedVoid, RemovedVolume, VoidState, measured_volume, opened, removed,
};
use brickfield_engine::milling::{Move, Program, ProgramOptions, Tool, read};
use brickfield_engine::part::{PartFile, directory_of};
use brickfield_engine::store::{AcceptedStores, BrickTree, Meta, Source, Store, hash_of};
use brickfield_engine::swept::SweptSolid;
use brickfield_engine::voids::VoidOptions;
use serde::{Serialize, Serializer};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::Path;
use std::time::Instant;

/// Chords stay within this part of a cell of their arcs.
const ARC_CELLS: f64 = 1.0 / 200.0;
/// Largest turn of the tool in one step, as the sine of the angle: a degree.
const TURN: f64 = 0.017_5;
/// A rapid move that takes off less than this part of a cell only touches.
const TOUCH_CELLS: f64 = 0.01;
/// Changes of the tool up to which each one's volume is measured, and not taken from its shares.
const MOST_MEASURED: usize = 16;
/// Rapid moves that are told one by one.
const MOST_TOLD: usize = 10;

/// Names of the columns, in order.
const COLUMNS: [&str; 9] = ["id", "volume", "state", "ligament", "move_first", "x", "y", "z", "line_first"];

/// A part and a program that are ready.
struct Job<'a> {
    args: &'a MachineArgs,
    store: Store,
    program: Program,
    cut: Cut,
    /// mm in the store's unit.
    unit: f64,
    arc_tolerance: f64,
    bars: Bars,
}

/// What was found out.
struct MachineFindings {
    summary: CsgSummary,
    total: BoundedVolume,
    /// By place in the list of tools.
    by_tool: Vec<BoundedVolume>,
    removed: RemovedVolume,
    voids: Option<Vec<OpenedVoid>>,
    /// Seconds by phase.
    phases: Vec<(&'static str, f64)>,
}

/// What JSON tells.
#[derive(Serialize)]
struct MachineDocument<'a> {
    #[serde(flatten)]
    head: Value,
    by_move: MovesOf<'a>,
    #[serde(flatten)]
    rest: Value,
}

/// What each move takes off: told one by one, since of a million moves all together take more memory than all else.
struct MovesOf<'a> {
    program: &'a Program,
    removed: &'a RemovedVolume,
}

/// A move in JSON.
#[derive(Serialize)]
struct MoveRow {
    #[serde(rename = "move")]
    number: u32,
    line: u64,
    rapid: bool,
    tool: u32,
    volume: f64,
    z_min: f64,
    z_max: f64,
}

impl Serialize for MovesOf<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(self.removed.by_move.iter().map(|(number, share)| {
            let of = &self.program.moves[*number as usize];
            let tool = self.program.tools[of.tool as usize].0;
            let [z_min, z_max] = share.height;
            let Move { line, rapid, .. } = *of;
            MoveRow { number: number + 1, line, rapid, tool, volume: share.volume, z_min, z_max }
        }))
    }
}

/// Runs the command.
pub fn run(args: &MachineArgs) -> Result<(), Failure> {
    let begun = Instant::now();
    require_store_name(&args.output, false)?;
    let kind = args.voids.as_deref().map(TableKind::of).transpose()?;
    let bars = start(args.work)?;
    let store = open_store(&args.store, 64 << 20, args.io, AcceptedStores::Whole)?;
    require_whole_samples(&store, "what is inside cannot be told")?;
    let outputs: Vec<&Path> = std::iter::once(args.output.as_path()).chain(args.voids.as_deref()).collect();
    let mut inputs = vec![args.store.as_path(), args.program.as_path()];
    inputs.extend(args.tools.as_deref());
    require_distinct(&outputs, &inputs)?;
    let unit = millimetres(&store.meta().unit).ok_or_else(|| {
        anyhow!("{}: the store has no unit of length; build it with --unit", in_line(&args.store))
    })?;
    let options = options(args, &store, unit)?;
    let program = read(&args.program, &options)?;
    let cut = Cut::new(&program, store.root(), unit, args.keeping.memory.0 / 4 * 3)?;
    let job = Job { args, store, program, cut, unit, arc_tolerance: options.arc_tolerance, bars };
    let file = match (&args.voids, kind) {
        (Some(path), Some(kind)) => Some((PartFile::create(path)?, kind)),
        _ => None,
    };
    let found = job.work()?;
    job.bars.clear();
    job.warn(&found);
    let document = job.document(&found, begun.elapsed().as_secs_f64());
    if let (Some((mut file, kind)), Some(voids)) = (file, &found.voids) {
        job.table(voids).append_to(&mut file, kind, &document)?;
        file.finish()?;
    }
    if args.json {
        print_json(&document)
    } else if !args.work.quiet {
        print(&job.text(&found, begun.elapsed().as_secs_f64()))
    } else {
        Ok(())
    }
}

fn options(args: &MachineArgs, store: &Store, unit: f64) -> Result<ProgramOptions, Failure> {
    let mut tools = BTreeMap::new();
    if let Some(path) = &args.tools {
        tools = table_of_tools(path)?;
    }
    let mut tool = None;
    for (n, NumberedTool(number, of)) in args.tool.iter().enumerate() {
        if args.tool[..n].iter().any(|before| before.0 == *number) {
            let which = number.map_or("without a number".to_owned(), |number| format!("{number}="));
            return Err(Failure::Usage(format!("--tool {which}: is given twice; give each tool once")));
        }
        match number {
            Some(number) => drop(tools.insert(*number, *of)),
            None => tool = Some(*of),
        }
    }
    let cell = store.root().spacing(store.meta().depth) * unit;
    let tolerance = match args.arc_tolerance {
        Some(length) => length.in_unit(crate::units::Unit::Mm),
        None => cell * ARC_CELLS,
    };
    let radii = args
        .radius
        .iter()
        .map(|NumberedRadius(number, of)| (*number, of.in_unit(crate::units::Unit::Mm)))
        .collect();
    Ok(ProgramOptions {
        tools,
        tool,
        radii,
        arc_tolerance: tolerance,
        turn: TURN,
        memory: args.keeping.memory.0 / 2,
    })
}

/// Tools from a table.
fn table_of_tools(path: &Path) -> Result<BTreeMap<u32, Tool>, Failure> {
    let name = in_line(path);
    let text = std::fs::read_to_string(path).with_context(|| format!("{name}: cannot read the tools"))?;
    let table: toml::Table = text.parse().map_err(|error: toml::de::Error| {
        anyhow!("{name}: {}; write [tools] and lines as 3 = \"flat:6mm\"", error.message())
    })?;
    let wrong = |what: String| anyhow!("{name}: {what}; write [tools] and lines as 3 = \"flat:6mm\"");
    let tools = table
        .get("tools")
        .and_then(toml::Value::as_table)
        .ok_or_else(|| wrong("there are no tools".into()))?;
    let mut found = BTreeMap::new();
    for (number, form) in tools {
        let parsed = number.parse::<u32>().map_err(|_| wrong(format!("{number} is no number of a tool")))?;
        let form = form.as_str().ok_or_else(|| wrong(format!("tool {number} is no text")))?;
        found.insert(parsed, form.parse().map_err(|what| wrong(format!("tool {number}: {what}")))?);
    }
    Ok(found)
}

impl Job<'_> {
    fn work(&self) -> Result<MachineFindings, Failure> {
        let Job { args, store, cut, bars, .. } = self;
        let settings = vec![
            ("made by".to_owned(), "machine".to_owned()),
            ("counts".to_owned(), if args.keep_counts { "kept" } else { "clamped" }.to_owned()),
            ("deviation of chords".to_owned(), self.arc_tolerance.to_string()),
            ("tools".to_owned(), format!("{:?}", self.program.tools)),
        ];
        let pace = pace(args.keeping.commit_every)?;
        let writing = Writing { memory: self.memory(), pace, restart: args.keeping.restart, settings };
        // What is left and what is taken off ask for the same bricks of what the tools sweep.
        let made = SweptBricks::new(directory_of(&args.output));
        let chain = Chain { made: Some(&made), ..self.chain(Operation::Minus, &cut.solids) };
        let meta = self.meta()?;
        let mut clock = Instant::now();
        let mut phases = Vec::new();
        let mut lap = |name| {
            phases.push((name, clock.elapsed().as_secs_f64()));
            clock = Instant::now();
        };
        let summary = chain.write(&args.output, meta.clone(), writing, bars)?;
        lap("cut");
        let total = self.taken(&cut.solids, Some(&made), &meta)?;
        drop(made);
        lap("measure");
        let removed = removed(store, cut, bars)?;
        lap("attribute");
        let by_tool = self.by_tool(total, &removed, &meta)?;
        let removed = removed.scaled_to(total.value);
        lap("tools");
        let voids = match &args.voids {
            Some(_) => {
                let options = VoidOptions { memory: self.memory(), ..VoidOptions::default() };
                Some(opened(store, cut, &options, bars)?)
            }
            None => None,
        };
        lap("voids");
        Ok(MachineFindings { summary, total, by_tool, removed, voids, phases })
    }

    /// Bytes beside those of the moves and of what they sweep.
    fn memory(&self) -> u64 {
        self.args.keeping.memory.0.saturating_sub(self.cut.bytes(&self.program))
    }

    /// What the result says of where it comes from.
    fn meta(&self) -> Result<Meta, Failure> {
        let Job { args, store, .. } = self;
        let bytes = std::fs::read(&args.program)
            .with_context(|| format!("{}: cannot read the program", in_line(&args.program)))?;
        let program = Source {
            path: args.program.display().to_string(),
            bytes: bytes.len() as u64,
            facets: 0,
            format: "milling program, minus".to_owned(),
            blake3: hash_of(&bytes),
        };
        let name = concat!("brickfield ", env!("CARGO_PKG_VERSION"), ", machine");
        Ok(meta_of(store, &[], &[], vec![source_of(store, "first")?, program], name))
    }

    fn chain<'c>(&'c self, operation: Operation, solids: &'c [SweptSolid]) -> Chain<'c> {
        let operands =
            vec![(Operation::Plus, Operand::Store(&self.store)), (operation, Operand::Solids(solids))];
        let keep_counts = self.args.keep_counts && operation == Operation::Minus;
        Chain { operands, keep_counts, depth: self.store.meta().depth, made: None }
    }

    /// What solids have in common with the part.
    fn taken(
        &self,
        solids: &[SweptSolid],
        made: Option<&SweptBricks>,
        meta: &Meta,
    ) -> Result<BoundedVolume, Failure> {
        let chain = Chain { made, ..self.chain(Operation::And, solids) };
        let Job { args, bars, .. } = self;
        Ok(measured_volume(&chain, meta.clone(), &args.output, self.memory(), bars)?)
    }

    /// What each tool takes off: measured from change to change of the tool.
    fn by_tool(
        &self,
        total: BoundedVolume,
        removed: &RemovedVolume,
        meta: &Meta,
    ) -> Result<Vec<BoundedVolume>, Failure> {
        let moves = &self.program.moves;
        let mut taken = vec![BoundedVolume::default(); self.program.tools.len()];
        let ends: Vec<usize> =
            (1..=moves.len()).filter(|&n| n == moves.len() || moves[n].tool != moves[n - 1].tool).collect();
        if ends.len() > MOST_MEASURED {
            let sum: f64 = removed.by_move.values().map(|share| share.volume).sum();
            for (number, share) in &removed.by_move {
                taken[moves[*number as usize].tool as usize].value += share.volume * total.value / sum;
            }
            taken.iter_mut().for_each(|of| of.error = total.error + (total.value - sum).abs());
            return Ok(taken);
        }
        let mut before = BoundedVolume::default();
        for end in ends {
            let solids = self.cut.moves.partition_point(|&number| (number as usize) < end);
            let is_all = end == moves.len();
            let now = if is_all { total } else { self.taken(&self.cut.solids[..solids], None, meta)? };
            let of = &mut taken[moves[end - 1].tool as usize];
            of.value += now.value - before.value;
            of.error += now.error + before.error;
            before = now;
        }
        Ok(taken)
    }

    /// Rapid moves that run into the part: their numbers, and how deep.
    fn rapids(&self, found: &MachineFindings) -> Vec<(u32, f64)> {
        let cell = self.store.root().spacing(self.store.meta().depth);
        let runs = found.removed.by_move.iter().filter(|(number, share)| {
            self.program.moves[**number as usize].rapid && share.volume > TOUCH_CELLS * cell.powi(3)
        });
        runs.map(|(number, share)| (*number, share.height[1] - share.height[0] + cell)).collect()
    }

    fn warn(&self, found: &MachineFindings) {
        let name = in_line(&self.args.program);
        let unit = unit_of(self.store.meta());
        let cell = self.store.root().spacing(self.store.meta().depth);
        let rapids = self.rapids(found);
        for (number, depth) in rapids.iter().take(MOST_TOLD) {
            let line = self.program.moves[*number as usize].line;
            let depth = measured(*depth, cell);
            warn(&format!("{name}: line {line}: a rapid move goes {depth} {unit} deep through the part"));
        }
        if rapids.len() > MOST_TOLD {
            let more = rapids.len() - MOST_TOLD;
            warn(&format!("{name}: {more} more rapid moves go through the part; --json lists them"));
        }
        if found.total.value <= 0.0 {
            let part = in_line(&self.args.store);
            warn(&format!("{name}: the tools never meet the part, so the result is {part} as it is"));
        }
    }

    fn table(&self, voids: &[OpenedVoid]) -> Table<'static> {
        let cell = self.store.root().spacing(self.store.meta().depth);
        let length = |value: f64| to_place(value, cell / 100.0);
        let row = |opened: &OpenedVoid| {
            let OpenedVoid { void, state, ligament, first } = opened;
            let mut cells = vec![json!(void.id), to_place(void.volume, void.volume_error / 10.0)];
            cells.push(json!(state.name()));
            cells.push(ligament.map_or(Value::Null, length));
            cells.push(first.map_or(Value::Null, |number| json!(number + 1)));
            cells.extend(void.centroid.map(length));
            let line = first.map(|number| self.program.moves[number as usize].line);
            cells.push(json!(line));
            cells
        };
        Table::of_rows(&COLUMNS, voids.iter().map(row).collect())
    }

    fn document<'f>(&'f self, found: &'f MachineFindings, seconds: f64) -> MachineDocument<'f> {
        let MachineFindings { summary, total, by_tool, removed, voids, phases } = found;
        let tools: Vec<Value> = self.program.tools.iter().zip(by_tool).map(|((number, tool), of)| {
            json!({ "number": number, "tool": tool.to_string(), "volume": of.value, "volume_error": of.error })
        }).collect();
        let rapids: Vec<Value> = self.rapids(found).iter().map(|(number, depth)| {
            json!({ "move": number + 1, "line": self.program.moves[*number as usize].line, "depth": depth })
        }).collect();
        let head = json!({
            "output": self.args.output.display().to_string(),
            "unit": unit_of(self.store.meta()),
            "cell": self.store.root().spacing(self.store.meta().depth),
            "nodes": summary.nodes,
            "leaves": summary.leaves,
            "file_bytes": summary.file_bytes,
            "hidden_walls": summary.hidden.walls,
            "resumed_nodes": summary.resumed,
            "moves": self.program.moves.len(),
            "arcs": self.program.arcs,
            "arc_error": self.program.chord_error / self.unit,
            "corner_error": self.cut.corner_error,
            "turn_error": self.cut.turn_error,
            "skipped_words": self.program.skipped,
            "turning_steps": self.program.turning_steps,
            "unplaced_moves": self.program.unplaced,
            "removed_volume": total.value,
            "removed_volume_error": total.error,
            "tools": tools,
        });
        let rest = json!({
            "rapid_through_part": rapids,
            "voids": voids.as_ref().map(|voids| self.table(voids).objects()),
            "phases": phases,
            "seconds": seconds,
        });
        MachineDocument { head, by_move: MovesOf { program: &self.program, removed }, rest }
    }

    fn text(&self, found: &MachineFindings, seconds: f64) -> String {
        let unit = unit_of(self.store.meta());
        let mut lines = vec![csg_text(&self.args.output, &found.summary, seconds)];
        let Program { moves, arcs, chord_error, turning_steps, unplaced, .. } = &self.program;
        let mut told = format!("{} moves", moves.len());
        if *arcs > 0 {
            told += &format!(", {arcs} arcs as chords within {:.6} {unit}", chord_error / self.unit);
        }
        if self.cut.corner_error > 0.0 {
            told += &format!(", rounded corners within {:.6} {unit}", self.cut.corner_error);
        }
        if *turning_steps > 0 {
            let error = self.cut.turn_error;
            told += &format!(", {turning_steps} steps of a turning tool within {error:.6} {unit}");
        }
        if *unplaced > 0 {
            told += &format!(", {unplaced} rapid ones to or from an unknown place left out");
        }
        if !self.program.skipped.is_empty() {
            let words = self.program.skipped.iter().map(|(word, count)| format!("{word} ({count})"));
            told += &format!(", unknown words left out: {}", words.collect::<Vec<_>>().join(", "));
        }
        lines.push(format!("  program  {told}"));
        lines.push(format!("  removed  {} {unit}³", measured(found.total.value, found.total.error)));
        for ((number, tool), of) in self.program.tools.iter().zip(&found.by_tool) {
            lines.push(format!("  T{number:<7} {tool}: {} {unit}³", measured(of.value, of.error)));
        }
        if let Some(voids) = &found.voids {
            let count = |state: VoidState| voids.iter().filter(|void| void.state == state).count();
            let [untouched, opened, consumed] =
                [VoidState::Untouched, VoidState::Opened, VoidState::Consumed].map(count);
            lines.push(format!("  voids    {untouched} untouched, {opened} opened, {consumed} consumed"));
        }
        lines.join("\n")
    }
}
