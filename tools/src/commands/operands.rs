//! Operands of Booleans: stores, inputs that are built for the time of a command, and bodies.

use super::{of_file, open_inputs, open_store, require_whole_samples};
use crate::args::IoArg;
use crate::bodies::body;
use crate::failure::Failure;
use crate::kinds::{FileKind, typed};
use crate::memory;
use crate::output::in_line;
use crate::toolpaths::solids;
use crate::units::Size;
use anyhow::anyhow;
use brickfield_engine::Progress;
use brickfield_engine::build::{BuildOptions, Resolution, Resources, build_opened};
use brickfield_engine::csg::{Operand, Operation, Primitive};
use brickfield_engine::ingest::OpenOptions;
use brickfield_engine::part::temporary::BesideFile;
use brickfield_engine::store::{AcceptedStores, BrickTree, Source, Store, hash_of};
use brickfield_engine::swept::SweptSolid;
use std::path::Path;

/// An operand that is ready.
pub struct OpenOperand {
    pub content: OperandContent,
    /// What the result says of it.
    pub source: Source,
    /// Its store, if it was built for now.
    _temporary: Option<BesideFile>,
}

pub enum OperandContent {
    Store(Box<Store>),
    Body(Vec<SweptSolid>, [[f64; 3]; 2]),
}

impl OpenOperand {
    /// For the engine.
    pub fn operand(&self) -> Operand<'_> {
        match &self.content {
            OperandContent::Store(store) => Operand::Store(store),
            OperandContent::Body(solids, _) => Operand::Solids(solids),
        }
    }
}

/// What operands have in common.
pub struct Common<'a> {
    pub first: &'a Store,
    pub output: &'a Path,
    pub memory: Size,
    pub io: IoArg,
    pub progress: &'a dyn Progress,
}

/// What the result says of a store.
///
/// # Errors
/// If it cannot be read.
pub fn source_of(store: &Store, role: &str) -> Result<Source, Failure> {
    Ok(Source {
        path: store.path().display().to_string(),
        bytes: store.file_bytes(),
        facets: 0,
        format: format!("brick store, {role}"),
        blake3: store.hash()?,
    })
}

/// Opens, builds or understands an operand.
///
/// # Errors
/// One that is none, or is of another lattice.
pub fn ready(
    number: usize,
    operation: Operation,
    text: &str,
    common: &Common<'_>,
) -> Result<OpenOperand, Failure> {
    let unit = &common.first.meta().unit;
    if !Path::new(text).exists()
        && let Some(found) = body(text, unit)
    {
        let option = format!("--{} '{text}'", operation.name());
        let body = found.map_err(|what| Failure::Usage(format!("{option}: {what}")))?;
        return of_body(text, &option, operation, body, common);
    }
    let path = Path::new(text);
    if !path.exists() && looks_like_a_body(text) {
        let option = format!("--{} '{text}'", operation.name());
        return Err(Failure::Usage(format!(
            "{option}: this is no file, and no body that is known; give {BODIES}"
        )));
    }
    let input = FileKind::of(path).filter(|kind| kind.is_input());
    let (store, temporary) = match input {
        Some(_) => {
            let temporary = build_for_now(number, path, common)?;
            (open_store(temporary.path(), 0, common.io, AcceptedStores::Whole)?, Some(temporary))
        }
        None => (open_store(path, 0, common.io, AcceptedStores::Whole)?, None),
    };
    require_whole_samples(&store, "what is inside cannot be told").map_err(|failure| match &temporary {
        Some(_) => {
            let what = "it is open, or a cloud, so what is inside cannot be told exactly";
            anyhow!("{}: {what}; close it, or build it from the toolpath", in_line(path)).into()
        }
        None => failure,
    })?;
    require_like(&store, common.first)?;
    let source = match &temporary {
        None => source_of(&store, operation.name())?,
        Some(_) => {
            let found = store.meta().sources.first().cloned().ok_or_else(|| anyhow!("{text}: no source"))?;
            Source { format: format!("{}, {}", found.format, operation.name()), ..found }
        }
    };
    Ok(OpenOperand { content: OperandContent::Store(Box::new(store)), source, _temporary: temporary })
}

/// Bodies, in the words of a message.
const BODIES: &str =
    "`z>20mm`, `box 0,0,0,10,10,5`, `cylinder 31,31,r15mm,z`, `sphere 5,5,5,r2`, or a file that is there";

/// Whether a text that is no file was rather meant for a body.
fn looks_like_a_body(text: &str) -> bool {
    let kind: String = text.trim().chars().take_while(char::is_ascii_alphabetic).collect();
    let is_named = ["box", "cylinder", "sphere"].contains(&kind.to_lowercase().as_str());
    let has_end = Path::new(text).extension().is_some_and(|end| {
        end.to_str().is_some_and(|end| {
            end.starts_with(|c: char| c.is_ascii_alphabetic())
                && end.chars().all(|c| c.is_ascii_alphanumeric())
        })
    });
    is_named || (!has_end && text.contains(['<', '>', '=', ',', ' ']))
}

/// Refuses a store whose samples stand elsewhere.
fn require_like(store: &Store, first: &Store) -> Result<(), Failure> {
    if store.root() == first.root() && store.meta().unit == first.meta().unit {
        return Ok(());
    }
    let (other, first) = (in_line(store.path()), typed(first.path()));
    let what = format!("its samples do not stand where those of {} do", first);
    Err(anyhow!("{other}: {what}; build it again: `brickfield build INPUT -o {other} --like {first}`").into())
}

fn of_body(
    text: &str,
    option: &str,
    operation: Operation,
    body: Primitive,
    common: &Common<'_>,
) -> Result<OpenOperand, Failure> {
    if operation == Operation::Plus && body.is_endless() {
        let what =
            "this has no end, so it cannot be joined to a part; give a box, or a cylinder with two ends";
        return Err(Failure::Usage(format!("{option}: {what}")));
    }
    let root = common.first.root();
    let bounds = body.bounds();
    let leaves = |a: usize| bounds[0][a] < root.origin[a] || bounds[1][a] > root.origin[a] + root.edge;
    if operation == Operation::Plus && (0..3).any(leaves) {
        let what = "this does not fit into the root cube of the first store";
        return Err(Failure::Usage(format!(
            "{option}: {what}; build that with a larger --cell, or give less"
        )));
    }
    let solid = body.solid(root).map_err(|error| Failure::Usage(format!("{option}: {error}")))?;
    let source = Source {
        path: text.to_owned(),
        bytes: 0,
        facets: 0,
        format: format!("body, {}", operation.name()),
        blake3: hash_of(text.as_bytes()),
    };
    Ok(OpenOperand { content: OperandContent::Body(vec![solid], bounds), source, _temporary: None })
}

/// Builds a mesh or a toolpath on the lattice of the first store, beside the output.
fn build_for_now(number: usize, path: &Path, common: &Common<'_>) -> Result<BesideFile, Failure> {
    let temporary = BesideFile::new(common.output, &format!(".operand-{number}"));
    let open = OpenOptions::default();
    let inputs = open_inputs(&[path.to_owned()], &[common.output], &open, common.progress)?;
    let (outline, _) = solids(None, &open.sweep.shape, &inputs)?;
    let mut options = BuildOptions {
        resolution: Resolution::Like(common.first.root(), common.first.meta().depth),
        unit: common.first.meta().unit.clone(),
        solids: outline,
        program: concat!("brickfield ", env!("CARGO_PKG_VERSION")).to_owned(),
        ..BuildOptions::default()
    };
    options.keeping.restart = true;
    let room = memory::require_room(&inputs, &options, Some(common.memory))?;
    options.resources = Resources { memory: room, index: memory::index_share(room), ..Resources::default() };
    build_opened(&inputs, temporary.path(), &options, common.progress)
        .map_err(|error| of_file(path, error))?;
    Ok(temporary)
}
