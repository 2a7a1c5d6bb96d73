//! `brickfield thickness --volume`: local thickness at every sample.

use super::{no_unit, of_store, require_level, unit_of};
use crate::distance_args::ThicknessArgs;
use crate::failure::Failure;
use crate::measured::measured;
use crate::output::in_line;
use crate::progress::Bars;
use crate::space::{require_space, tell_left_behind};
use crate::table::to_place;
use crate::units::Length;
use anyhow::Context;
use brickfield_engine::analysis::Element;
use brickfield_engine::distance::{LocalOf, LocalSpread, LocalThickness, Surface};
use brickfield_engine::export::{Format, Quantity, Volume, format_of, listed_endings};
use brickfield_engine::lattice::BRICK_CELLS;
use brickfield_engine::store::{BrickTree, Store};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// The volume that was asked for.
pub(super) struct VolumePlan<'a> {
    output: &'a Path,
    format: &'static dyn Format,
    /// The second file, of formats that have one.
    beside: Option<PathBuf>,
    level: Option<u8>,
    gaps: bool,
    widest: Option<Length>,
    quiet: bool,
}

impl VolumePlan<'_> {
    /// What the user typed, checked; `None` without `--volume`.
    pub fn of(args: &ThicknessArgs) -> Result<Option<VolumePlan<'_>>, Failure> {
        let Some(output) = args.volume.as_deref() else { return Ok(None) };
        let Some(format) = format_of(output) else {
            let (name, endings) = (in_line(output), listed_endings());
            return Err(Failure::Usage(format!("{name}: the name of a volume ends in one of {endings}")));
        };
        if args.gaps && args.widest.is_none() {
            return Err(Failure::Usage(
                "gaps as a volume need --widest: what is wider is free space".to_owned(),
            ));
        }
        let beside = format.beside().map(|ending| output.with_extension(ending));
        let (level, gaps, widest, quiet) = (args.level, args.gaps, args.widest, args.work.quiet);
        Ok(Some(VolumePlan { output, format, beside, level, gaps, widest, quiet }))
    }

    /// All files that are written.
    pub fn outputs(&self) -> impl Iterator<Item = &Path> {
        std::iter::once(self.output).chain(self.beside.as_deref())
    }

    /// Refuses a name that cannot be written, before the work.
    pub fn require_writable(&self) -> Result<(), Failure> {
        tell_left_behind(self.output, self.quiet);
        Ok(self.format.require_writable(self.output)?)
    }

    fn chosen(&self, store: &Store) -> u8 {
        self.level.unwrap_or_else(|| store.deepest_level())
    }

    /// Writes the volume, with balls in so many bytes of memory.
    pub fn write(
        &self,
        (store, surface): (&Store, &Surface),
        held: (u64, &Path),
        bars: &Bars,
    ) -> Result<LocalSpread, Failure> {
        let level = self.chosen(store);
        require_level(store, level)?;
        let unit = &store.meta().unit;
        let of = match self.widest.filter(|_| self.gaps) {
            Some(widest) => LocalOf::Gaps(widest.in_unit_of(unit).ok_or_else(no_unit)?),
            None => LocalOf::Walls,
        };
        let told = |error| of_store(store, "thickness", error);
        let tree = LocalThickness::new((store, surface), of, level, held, bars).map_err(told)?;
        let description = self.description(store);
        let text = serde_json::to_string_pretty(&description).context("cannot write JSON")? + "\n";
        let volume = Volume {
            tree: &tree,
            levels: vec![level],
            quantity: Quantity::Thickness,
            element: Element::F32,
            name: "thickness",
            unit: Some(unit.as_str()).filter(|unit| *unit != "unit"),
            description: &text,
        };
        let bytes = self.format.bytes_about(&volume).try_into().unwrap_or(u64::MAX);
        require_space(self.output, bytes, "choose a lower --level")?;
        self.format.write(&volume, self.output, bars).map_err(told)?;
        Ok(tree.spread().map_err(told)?)
    }

    fn description(&self, store: &Store) -> Value {
        let level = self.chosen(store);
        let (axis, root) = (BRICK_CELLS << level, store.root());
        json!({
            "array": self.output.file_name().map(|name| name.to_string_lossy().into_owned()),
            "store": store.path().display().to_string(),
            "level": level,
            "levels": [level],
            "quantity": "thickness",
            "of": if self.gaps { "gaps" } else { "walls" },
            "order": "zyx",
            "shape": [axis, axis, axis],
            "dtype": Element::F32.numpy(),
            "origin": root.to_world([1.0; 3]),
            "spacing": root.spacing(level),
            "unit": store.meta().unit,
        })
    }

    /// How thickness is spread.
    pub fn document(&self, store: &Store, spread: &LocalSpread) -> Value {
        let spacing = store.root().spacing(self.chosen(store));
        let length = |value: f64| to_place(value, spread.step / 10.0);
        json!({
            "file": self.output.display().to_string(),
            "level": self.chosen(store),
            "spacing": spacing,
            "of": if self.gaps { "gaps" } else { "walls" },
            "samples": spread.samples,
            "mean": length(spread.mean),
            "mean_error": length(spread.mean_error),
            "standard_deviation": length(spread.deviation),
            "standard_deviation_error": length(spread.deviation_error),
            "max": length(spread.max),
            "step": spread.step,
            "histogram": {
                "from": 0.0,
                "to": spread.bar * spread.histogram.len() as f64,
                "counts": spread.histogram,
            },
        })
    }

    /// The same for people.
    pub fn summary(&self, store: &Store, spread: &LocalSpread) -> String {
        let unit = unit_of(store.meta());
        let axis = BRICK_CELLS << self.chosen(store);
        format!(
            "{}: {axis} × {axis} × {axis}, {} samples of {}; local thickness {} {unit} in the mean over the volume, \
             standard deviation {}, largest {}",
            in_line(self.output),
            spread.samples,
            if self.gaps { "gaps" } else { "walls" },
            measured(spread.mean, spread.mean_error),
            measured(spread.deviation, spread.deviation_error),
            to_place(spread.max, spread.step)
        )
    }
}
