//! From the file's text to sweeps and their places: hierarchy, DEF and USE.
//!
//! The text is walked once. What is kept of a node with a DEF name is which Extrusions stand in it and where,
//! a few numbers each, not their geometry; what a USE shows again refers to an Extrusion by its number.

use super::affine::Transform;
use super::extrusion::{Extrusion, Sink, X3dItem};
use super::fields;
use super::node::{self, NodeRole};
use super::report::X3dReport;
use crate::error::{Error, Result};
use crate::progress::Progress;
use glam::DAffine3;
use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};
use std::collections::HashMap;
use std::path::Path;

/// Bytes between two reports of progress (and looks at whether the user wants to stop).
const REPORT_BYTES: u64 = 1 << 20;

/// Deepest nesting of elements; scenes have a dozen levels.
const DEPTH_MAX: usize = 1024;

/// Most Extrusions that USE may place: a few lines that use each other would otherwise place any number.
const USED_MAX: u64 = 1 << 20;

const REMEDY: &str = "export or copy the file again";

/// Reads `bytes`, the content of the X3D file `path`, and hands its sweeps to `sink`, in the file's order.
/// Memory is that of the largest Extrusion, and some 200 bytes for each node with a DEF name.
///
/// An Extrusion with wrong fields is left out and reported, as the specification calls what it shows
/// undefined; so are other geometry nodes, prototypes and inlined files. A Switch shows the child that it
/// chooses, an LOD its first one.
///
/// # Errors
/// If the text is no well-formed XML or no X3D; if it is nested more than 1,024 levels deep or USE places
/// more than 1,048,576 Extrusions; what `sink` returns; if the user interrupts.
pub fn read(path: &Path, bytes: &[u8], progress: &dyn Progress, sink: &mut Sink<'_>) -> Result<X3dReport> {
    if bytes.starts_with(b"\xff\xfe") || bytes.starts_with(b"\xfe\xff") {
        return Err(Error::input(path, "byte 0", "is text in UTF-16", "save it in UTF-8"));
    }
    let text = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let mut xml = Reader::from_reader(text);
    xml.config_mut().allow_dangling_amp = true;
    let mut lines = LineCounter { text, at: 0, line: 1 };
    let mut scene = Scene::new(path, sink);
    let mut reported = 0;
    loop {
        let start = xml.buffer_position();
        if start - reported >= REPORT_BYTES {
            progress.advance(start - reported);
            reported = start;
            progress.check()?;
        }
        let event = xml.read_event().map_err(|error| {
            let line = LineCounter { text, at: 0, line: 1 }.number(xml.error_position());
            not_xml(path, line, &error.to_string())
        })?;
        match event {
            Event::Start(tag) => scene.begin(&tag, lines.number(start))?,
            Event::Empty(tag) => {
                scene.begin(&tag, lines.number(start))?;
                scene.end();
            }
            Event::End(_) => scene.end(),
            Event::Eof => {
                progress.advance(start - reported);
                return scene.finish(lines.number(start));
            }
            _ => {}
        }
    }
}

fn not_xml(path: &Path, line: u64, what: &str) -> Error {
    let what: String = what.chars().map(|c| if c.is_control() { ' ' } else { c }).take(200).collect();
    Error::input(path, format!("line {line}"), format!("is no well-formed XML: {what}"), REMEDY)
}

/// Numbers of lines at growing positions.
struct LineCounter<'a> {
    text: &'a [u8],
    at: usize,
    line: u64,
}

impl LineCounter<'_> {
    /// Number of the line that holds byte `position`, from 1.
    fn number(&mut self, position: u64) -> u64 {
        let to = (position as usize).min(self.text.len());
        if let Some(passed) = self.text.get(self.at..to) {
            self.line += passed.iter().filter(|b| **b == b'\n').count() as u64;
            self.at = to;
        }
        self.line
    }
}

/// What a DEF name stands for.
#[derive(Clone, Copy, Debug)]
enum Target {
    Extrusion(u64),
    /// Index into [`Scene::definitions`].
    Definition(usize),
}

/// A target with the matrix from its coordinates to those around it.
type Part = (Target, DAffine3);

/// What stands in a node with a DEF name: at least two parts.
#[derive(Debug)]
struct Definition {
    parts: Vec<Part>,
    /// Extrusions in it, counted as often as they show.
    places: u64,
}

/// An element whose end has not come yet.
#[derive(Debug)]
struct OpenElement {
    kind: NodeRole,
    shown: bool,
    to_scene: DAffine3,
    /// To the coordinates around the innermost open node with a DEF name.
    to_definition: DAffine3,
    /// The DEF name, if what stands in the element is to be kept.
    def: Option<String>,
    /// Child nodes so far, and the one that shows (Switch, LOD).
    children: i64,
    choice: i64,
}

impl OpenElement {
    /// An element that changes nothing.
    fn like(parent: &OpenElement, kind: NodeRole) -> OpenElement {
        OpenElement { kind, def: None, children: 0, choice: 0, ..*parent }
    }
}

/// The walk through one file.
struct Scene<'a, 'b> {
    path: &'a Path,
    sink: &'a mut Sink<'b>,
    report: X3dReport,
    open: Vec<OpenElement>,
    /// Parts of the open nodes with a DEF name, outermost first.
    parts: Vec<Vec<Part>>,
    definitions: Vec<Definition>,
    /// `None` for nodes without any sweep.
    names: HashMap<String, Option<Part>>,
    extrusion: Extrusion,
    extrusions: u64,
    used: u64,
    begun: bool,
}

impl<'a, 'b> Scene<'a, 'b> {
    fn new(path: &'a Path, sink: &'a mut Sink<'b>) -> Scene<'a, 'b> {
        Scene {
            path,
            sink,
            report: X3dReport::default(),
            open: Vec::new(),
            parts: Vec::new(),
            definitions: Vec::new(),
            names: HashMap::new(),
            extrusion: Extrusion::default(),
            extrusions: 0,
            used: 0,
            begun: false,
        }
    }

    /// An element begins.
    fn begin(&mut self, tag: &BytesStart<'_>, line: u64) -> Result<()> {
        let name = tag.local_name().into_inner();
        let Some(parent) = self.open.last_mut() else {
            return self.begin_root(name, line);
        };
        let kind = match (parent.kind, node::kind(name)) {
            (NodeRole::Other, NodeRole::Extrusion) => {
                self.report.skip(line, "Extrusion in an element that is not read");
                NodeRole::Remark
            }
            // Nothing is looked for in such elements.
            (inert @ (NodeRole::Other | NodeRole::Skipped(_) | NodeRole::Remark), _) => inert,
            (NodeRole::Extrusion, _) => NodeRole::Remark,
            (_, kind) => kind,
        };
        let is_inside_inert = matches!(parent.kind, NodeRole::Skipped(_));
        let mut open = OpenElement::like(parent, kind);
        if matches!(parent.kind, NodeRole::Switch | NodeRole::Lod) && kind != NodeRole::Remark {
            open.shown &= parent.children == parent.choice;
            parent.children += 1;
        }
        match kind {
            NodeRole::Group | NodeRole::Transform | NodeRole::Switch | NodeRole::Lod => {
                self.group(&mut open, tag, name, line)?
            }
            NodeRole::Extrusion => self.extrusion(&open, tag, line)?,
            NodeRole::Skipped(name) if !is_inside_inert => self.report.skip(line, name),
            NodeRole::Skipped(_) | NodeRole::Remark | NodeRole::Other => {}
        }
        if self.open.len() >= DEPTH_MAX {
            let what = format!("elements are nested more than {DEPTH_MAX} levels deep");
            return Err(Error::input(self.path, format!("line {line}"), what, "write a flatter scene"));
        }
        self.open.push(open);
        Ok(())
    }

    fn begin_root(&mut self, name: &str, line: u64) -> Result<()> {
        let wrong = match (name, self.begun) {
            ("X3D", false) => None,
            (_, false) => Some(format!("the first element is {}, not X3D", fields::quote(name))),
            (_, true) => Some(format!("a second element {} follows the first", fields::quote(name))),
        };
        if let Some(what) = wrong {
            let remedy = "give an X3D file in the XML encoding (.x3d)";
            return Err(Error::input(self.path, format!("line {line}"), what, remedy));
        }
        self.begun = true;
        self.open.push(OpenElement {
            kind: NodeRole::Group,
            shown: true,
            to_scene: DAffine3::IDENTITY,
            to_definition: DAffine3::IDENTITY,
            def: None,
            children: 0,
            choice: 0,
        });
        Ok(())
    }

    /// A node that holds others begins, or shows what another holds.
    fn group(&mut self, open: &mut OpenElement, tag: &BytesStart<'_>, name: &str, line: u64) -> Result<()> {
        let mut matrix = Ok(Transform::default());
        if open.kind == NodeRole::Transform {
            matrix = fields::transform(tag.attributes());
        }
        // A Switch chooses nothing by itself.
        open.choice = if open.kind == NodeRole::Switch { -1 } else { 0 };
        let mut used = None;
        for (field, value) in fields::fields(tag.attributes()) {
            let Ok(value) = fields::text(value) else { continue };
            match field {
                "DEF" => open.def = Some(value.into_owned()),
                "USE" => used = Some(value.into_owned()),
                "whichChoice" => open.choice = value.trim().parse().unwrap_or(-1),
                "containerField" if value == "proxy" => open.shown = false,
                "visible" => open.shown &= fields::flag(&value) != Ok(false),
                _ => {}
            }
        }
        if let Some(used) = used {
            open.def = None;
            let (shown, to_scene, to_definition) = (open.shown, open.to_scene, open.to_definition);
            return self.show(name, &used, shown, to_scene, to_definition, line);
        }
        if open.def.is_some() {
            open.to_definition = DAffine3::IDENTITY;
            self.parts.push(Vec::new());
        }
        match matrix {
            Ok(transform) if open.kind == NodeRole::Transform => {
                let matrix = transform.matrix();
                open.to_scene *= matrix;
                open.to_definition *= matrix;
            }
            Ok(_) => {}
            Err(what) => {
                self.report
                    .refuse(line, format!("{} and all in it: {what}", named(name, open.def.as_deref())));
                open.shown = false;
                open.kind = NodeRole::Skipped("");
            }
        }
        Ok(())
    }

    /// An Extrusion: handed over if it shows anywhere or might.
    fn extrusion(&mut self, parent: &OpenElement, tag: &BytesStart<'_>, line: u64) -> Result<()> {
        self.extrusion.line = line;
        let used = match self.extrusion.fill(tag.attributes()) {
            Ok(used) => used,
            Err(what) => {
                let def = self.extrusion.def.take();
                self.report.refuse(line, format!("{}: {what}", named("Extrusion", def.as_deref())));
                if let Some(def) = def {
                    self.names.insert(def, None);
                }
                return Ok(());
            }
        };
        let (to_scene, to_definition) = (parent.to_scene, parent.to_definition);
        if let Some(used) = used {
            return self.show("Extrusion", &used, parent.shown, to_scene, to_definition, line);
        }
        if !parent.shown && self.parts.is_empty() && self.extrusion.def.is_none() {
            return Ok(());
        }
        let number = self.extrusions;
        self.extrusions += 1;
        self.report.extrusions += 1;
        (self.sink)(X3dItem::Extrusion(&self.extrusion))?;
        if let Some(def) = &self.extrusion.def {
            self.names.insert(def.clone(), Some((Target::Extrusion(number), DAffine3::IDENTITY)));
        }
        if let Some(parts) = self.parts.last_mut() {
            parts.push((Target::Extrusion(number), to_definition));
        }
        if parent.shown {
            self.place(number, to_scene)?;
        }
        Ok(())
    }

    /// Shows what the name `used` stands for once more.
    fn show(
        &mut self,
        node: &str,
        used: &str,
        shown: bool,
        to_scene: DAffine3,
        to_definition: DAffine3,
        line: u64,
    ) -> Result<()> {
        let Some(&known) = self.names.get(used) else {
            let what = format!("{node} USE={}: no node of that name ends before it", fields::quote(used));
            self.report.refuse(line, what);
            return Ok(());
        };
        let Some((target, matrix)) = known else { return Ok(()) };
        if let Some(parts) = self.parts.last_mut() {
            parts.push((target, to_definition * matrix));
        }
        if !shown {
            return Ok(());
        }
        self.used = self.used.saturating_add(self.places(target));
        if self.used > USED_MAX {
            let what = format!("USE places more than {USED_MAX} Extrusions");
            let remedy = "write a scene with fewer copies";
            return Err(Error::input(self.path, format!("line {line}"), what, remedy));
        }
        self.place_all(target, to_scene * matrix)
    }

    /// Extrusions that a target shows.
    fn places(&self, target: Target) -> u64 {
        match target {
            Target::Extrusion(_) => 1,
            Target::Definition(definition) => self.definitions[definition].places,
        }
    }

    /// Places all that a target shows. Definitions have two parts or more, so the time is in proportion to what
    /// is placed; they may refer to each other to any depth, so no recursion.
    fn place_all(&mut self, target: Target, to_scene: DAffine3) -> Result<()> {
        let mut ahead = vec![(target, to_scene)];
        while let Some((target, to_scene)) = ahead.pop() {
            match target {
                Target::Extrusion(number) => self.place(number, to_scene)?,
                Target::Definition(definition) => {
                    let parts = self.definitions[definition].parts.iter().rev();
                    ahead.extend(parts.map(|(target, matrix)| (*target, to_scene * *matrix)));
                }
            }
        }
        Ok(())
    }

    fn place(&mut self, extrusion: u64, to_scene: DAffine3) -> Result<()> {
        self.report.placed += 1;
        (self.sink)(X3dItem::Place { extrusion, to_scene })
    }

    /// An element ends.
    fn end(&mut self) {
        let Some(OpenElement { def: Some(def), .. }) = self.open.pop() else { return };
        let parts = self.parts.pop().unwrap_or_default();
        let known = match parts[..] {
            [] => None,
            [one] => Some(one),
            _ => {
                let places = parts.iter().fold(0, |sum: u64, p| sum.saturating_add(self.places(p.0)));
                self.definitions.push(Definition { parts, places });
                Some((Target::Definition(self.definitions.len() - 1), DAffine3::IDENTITY))
            }
        };
        if let (Some((target, matrix)), Some(outer), Some(parent)) =
            (known, self.parts.last_mut(), self.open.last())
        {
            outer.push((target, parent.to_definition * matrix));
        }
        self.names.insert(def, known);
    }

    /// The text ends, in line `line`.
    fn finish(self, line: u64) -> Result<X3dReport> {
        if !self.begun || !self.open.is_empty() {
            let what = match self.begun {
                true => format!("the file ends inside {} open elements", self.open.len()),
                false => "the file holds no element X3D".to_owned(),
            };
            return Err(Error::input(self.path, format!("line {line}"), what, REMEDY));
        }
        Ok(self.report)
    }
}

/// A node as a message names it.
fn named(node: &str, def: Option<&str>) -> String {
    match def {
        Some(def) => format!("{node} {}", fields::quote(def)),
        None => node.to_owned(),
    }
}
