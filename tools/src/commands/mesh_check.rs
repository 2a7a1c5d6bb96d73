//! `brickfield mesh --check`: whether a mesh is the border of a solid.

use super::info::point;
use crate::args::MeshArgs;
use crate::failure::Failure;
use crate::kinds::{FileKind, is_mesh_name};
use crate::output::{one_line, print, print_json};
use crate::units::Size;
use brickfield_engine::check::{CheckReport, Defect, check};
use brickfield_engine::ingest::{Facets, Input};
use brickfield_engine::lattice::RootCube;
use brickfield_engine::pieces::{Consistency, InsideOut, study};
use brickfield_engine::{Error, Progress};
use serde::Serialize;
use std::path::Path;
use std::time::Instant;

/// Checks the mesh that was given in place of a store.
pub fn run(args: &MeshArgs, progress: &crate::progress::Bars) -> Result<(), Failure> {
    let kind = FileKind::of(&args.file);
    if !is_mesh_name(&args.file) && !kind.is_some_and(FileKind::is_mesh) {
        let what = "--check takes a mesh file, or a store and -o";
        let is = kind.and_then(FileKind::name).map_or_else(String::new, |name| format!("is {name}; "));
        return Err(Failure::Usage(format!("{}: {is}{what}", args.file.display())));
    }
    let checked = CheckOutcome::of(&args.file, args.weld, args.memory, progress)?;
    progress.clear();
    if args.json {
        print_json(&checked)?;
    } else if !args.work.quiet {
        print(&checked.text())?;
    }
    require_sound(&checked)
}

/// What the check of a file said.
#[derive(Serialize)]
pub struct CheckOutcome {
    path: String,
    format: &'static str,
    sound: bool,
    closed: bool,
    oriented: bool,
    edge_manifold: bool,
    vertex_manifold: bool,
    free_of_intersections: bool,
    /// False if a closed shell that lies in no other faces inward; null if that cannot be told: the mesh is open, or the
    /// memory does not suffice.
    facing_outward: Option<bool>,
    inside_out: Option<InsideOut>,
    #[serde(flatten)]
    report: CheckReport,
    seconds: f64,
}

impl CheckOutcome {
    /// Reads and checks the mesh at `path`.
    pub fn of(
        path: &Path,
        weld: bool,
        memory: Size,
        progress: &dyn Progress,
    ) -> Result<CheckOutcome, Failure> {
        let started = Instant::now();
        let input = Input::open(path, progress)?;
        let report = check(&input, weld, progress)?;
        let facing = facing(&input, &report, memory, progress)?;
        let inside_out = facing.flatten();
        Ok(CheckOutcome {
            path: path.display().to_string(),
            format: input.describe(),
            sound: report.is_sound() && inside_out.is_none(),
            closed: report.is_closed(),
            oriented: report.is_oriented(),
            edge_manifold: report.is_edge_manifold(),
            vertex_manifold: report.is_vertex_manifold(),
            free_of_intersections: report.is_free_of_intersections(),
            facing_outward: facing.map(|found| found.is_none()),
            inside_out,
            report,
            seconds: started.elapsed().as_secs_f64(),
        })
    }

    /// The shells that are inside out, for people.
    fn inverted(&self) -> Option<String> {
        let InsideOut { pieces, volume, facet, .. } = self.inside_out?;
        let shells = if pieces == 1 { "shell is" } else { "shells are" };
        Some(format!(
            "{pieces} closed {shells} inside out, with a volume of {:.6}; the largest begins at triangle {facet}",
            -volume.abs()
        ))
    }

    /// For people.
    pub fn text(&self) -> String {
        let CheckOutcome { format, report, seconds, .. } = self;
        let path = one_line(&self.path);
        let CheckReport { triangles, vertices, edges, area, volume, .. } = report;
        let mut text = format!(
            "{path}: {format}, {triangles} triangles, {vertices} vertices, {edges} edges, {seconds:.2} s\n"
        );
        let judged = |good: bool, word: &str| if good { word.to_owned() } else { format!("not {word}") };
        text += &format!(
            "  surface  {}, {}, {}, {}, {}\n",
            judged(self.closed, "closed"),
            judged(self.oriented, "oriented"),
            judged(self.edge_manifold, "edge-manifold"),
            judged(self.vertex_manifold, "vertex-manifold"),
            judged(self.free_of_intersections, "free of self-intersections"),
        );
        text += &format!(
            "  shells   {}, {} of them facing inward; Euler characteristic {}{}\n",
            report.components,
            report.inward_components,
            report.euler_characteristic,
            report.genus.map_or(String::new(), |genus| format!(", genus {genus}")),
        );
        text += &format!("  size     area {area:.6}, volume {volume:.6}\n");
        if let Some([min, max]) = report.bounds {
            text += &format!("  bounds   {} to {}\n", point(min), point(max));
        }
        if let Some(inverted) = self.inverted() {
            text += &format!("  wrong    {inverted}\n");
        }
        for (what, Defect { count, at }) in report.defects() {
            let place = at.map_or(String::new(), |at| format!(", one at {}", point(at)));
            text += &format!("  wrong    {count} {what}{place}\n");
        }
        if let Some(pair) = report.intersections.first.first() {
            let [a, b] = pair.faces;
            text += &format!("           the first pair are the triangles {a} and {b}, counted from 0\n");
        }
        text
    }
}

/// The closed shells that face inward though nothing is around them; nothing if there are none, `None` if that cannot be
/// told. Shells that face inward within others are cavities.
fn facing(
    input: &Input,
    report: &CheckReport,
    memory: Size,
    progress: &dyn Progress,
) -> Result<Option<Option<InsideOut>>, Failure> {
    if !report.is_closed() || !report.is_oriented() {
        return Ok(None);
    }
    if report.inward_components == 0 {
        return Ok(Some(None));
    }
    let (min, max) = input.bounds(progress)?;
    let Some(root) = RootCube::around(min, max) else { return Ok(None) };
    match study(&[input as &dyn Facets], root, Consistency::Given, memory.0, progress) {
        Ok((pieces, _)) => Ok(Some(pieces.inside_out)),
        // Too little memory to tell.
        Err(Error::Setting { .. }) => Ok(None),
        Err(error) => Err(error.into()),
    }
}

/// Success exactly if nothing is wrong.
pub fn require_sound(checked: &CheckOutcome) -> Result<(), Failure> {
    if checked.sound {
        return Ok(());
    }
    let defects = checked.report.defects();
    let defects = defects.iter().map(|(what, defect)| format!("{} {what}", defect.count));
    let named: Vec<String> = checked.inverted().into_iter().chain(defects).collect();
    let what = if named.is_empty() { "no triangles".to_owned() } else { named.join(", ") };
    Err(anyhow::anyhow!("{}: {what}; repair the mesh before it is used as a solid", checked.path).into())
}
