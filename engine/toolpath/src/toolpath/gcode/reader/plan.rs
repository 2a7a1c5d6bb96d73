//! How a file is to be carried out: what deposits, in which unit, and which axis carries layers.

use super::beads::BeadAssembler;
use super::deposition::{DepositionSwitch, MachineFamily};
use super::file_scan::ScanFindings;
use super::layer_axis::LayerAxis;
use super::machine::Setup;
use super::options::{ExtruderAxis, GcodeOptions};
use super::report::UnitSource;
use super::sizes::Rise;
use super::survey::FileSurvey;

/// What a user may do about a file in which nothing was deposited.
pub(super) fn remedy(signs: &ScanFindings) -> String {
    let mut remedy =
        "give G-code whose moves have E words, or M3 and M5 around them; other codes by `deposit_on` and \
                      `deposit_off`"
            .to_owned();
    if let Some(axis) = signs.rising_axes().first() {
        remedy += &format!("; if {axis}, which only rises, feeds, say `extruder_axis` {axis}");
    }
    remedy
}

/// How a file is carried out.
#[derive(Clone)]
pub(super) struct ReadPlan {
    /// Whether the extruder's axis deposits; otherwise codes do.
    pub(super) by_extruder: bool,
    /// Whether the file gives the area of its beads.
    pub(super) has_area: bool,
    family: MachineFamily,
    /// Codes of another machine that stand in the file, too.
    rival: Option<MachineFamily>,
    unit: (f64, UnitSource),
    dialect: Option<String>,
    layer_axis: LayerAxis,
    bed: f64,
    usual_height: Option<f64>,
    /// What must be tried before: whether the axis moves with the layers, and which way.
    open: TrialGoal,
    is_trial: bool,
}

/// What a trial has to show.
#[derive(Clone, Copy, PartialEq, Eq)]
enum TrialGoal {
    Nothing,
    /// Whether and how the axis carries layers.
    Axis,
    /// Where the bed is.
    Bed,
}

impl ReadPlan {
    pub(super) fn new(options: &GcodeOptions, survey: &FileSurvey) -> ReadPlan {
        let signs = &survey.signs;
        let (family, rival) = signs.family();
        let by_codes = !options.deposit_on.is_empty();
        let by_extruder = survey.has_e && !by_codes;
        let unit = match (options.unit, signs.unit()) {
            (Some(unit), _) => (unit, UnitSource::Option),
            (None, Some(unit)) => (unit, UnitSource::Header),
            (None, None) => (1.0, UnitSource::Assumed),
        };
        let feeds = options.extruder_axis.map(ExtruderAxis::letter);
        let shown = signs.layer_axis().filter(|axis| axis.letter() != feeds);
        let layer_axis = options.layer_axis.or(shown).unwrap_or(LayerAxis::NONE);
        let open = match layer_axis.letter() {
            None => TrialGoal::Nothing,
            Some(b'Z') => TrialGoal::Bed,
            Some(_) if options.layer_axis.is_some() => TrialGoal::Bed,
            Some(_) => TrialGoal::Axis,
        };
        let by_family = family.filter(|_| !by_extruder && !by_codes).and_then(MachineFamily::machine);
        ReadPlan {
            by_extruder,
            has_area: family == Some(MachineFamily::Siemens) && !by_extruder && !by_codes,
            family: family.unwrap_or(MachineFamily::Spindle),
            // MELD's spindle stirs, and a gun's runs with it.
            rival: rival.filter(|_| {
                !by_extruder && !by_codes && !matches!(family, Some(MachineFamily::Meld | MachineFamily::Gun))
            }),
            unit,
            dialect: signs.machine.clone().or(by_family.map(str::to_owned)),
            layer_axis,
            bed: signs.bed.unwrap_or(0.0),
            usual_height: options.height.or(survey.settings.layer_height),
            open,
            is_trial: false,
        }
    }

    /// The plan of the next trial, if one is needed.
    pub(super) fn trial(&self) -> Option<ReadPlan> {
        (self.open != TrialGoal::Nothing).then(|| ReadPlan { is_trial: true, ..self.clone() })
    }

    /// Takes in what a trial showed.
    pub(super) fn learn(&mut self, beads: &BeadAssembler<'_, '_>) {
        let rise: &Rise = &beads.layering.rise;
        let moved = beads.tables.is_some_and(|(low, high)| high > low);
        match self.open {
            TrialGoal::Axis if !moved => {
                // Where it stands still, Z alone tells heights, as they stand in the file.
                self.layer_axis = LayerAxis::NONE;
                self.open = TrialGoal::Nothing;
            }
            TrialGoal::Axis if rise.downs > rise.ups => {
                // The part would grow downwards: the axis lifts the tool.
                let letter = self.layer_axis.letter().unwrap_or(b'W');
                self.layer_axis = LayerAxis::new(letter, false);
                self.open = TrialGoal::Bed;
            }
            _ => {
                self.bed = rise.bed(self.usual_height).unwrap_or(self.bed);
                self.open = TrialGoal::Nothing;
            }
        }
    }

    /// The caller's options; in a trial any size does.
    pub(super) fn options(&self, options: &GcodeOptions) -> GcodeOptions {
        let mut options = options.clone();
        if self.is_trial {
            options.width.get_or_insert(1.0);
            options.height.get_or_insert(1.0);
        }
        options
    }

    /// Tells the beads' gatherer what it needs.
    pub(super) fn prepare(
        &self,
        beads: &mut BeadAssembler<'_, '_>,
        options: &GcodeOptions,
        signs: &ScanFindings,
    ) {
        beads.layering.bed = self.bed;
        if let Some(rival) = self.rival {
            let list = |family: MachineFamily| family.codes().0.join(", ");
            let what = format!(
                "{} and {} both stand in the file: the first is taken for what deposits; if not, give `deposit_on` and \
                 `deposit_off`",
                list(self.family),
                list(rival)
            );
            beads.report.note(&what, 0);
        }
        let feeds = options.extruder_axis.map(ExtruderAxis::letter);
        for (letter, farthest) in signs.wide_turns() {
            if feeds == Some(letter) || options.layer_axis.is_some_and(|axis| axis.letter() == Some(letter)) {
                continue;
            }
            let axis = char::from(letter);
            let what = format!(
                "{axis} goes to {farthest} and is read as degrees by which the head turns; if it feeds, say \
                 `extruder_axis` {axis}; if it carries layers, `layer_axis` {axis} or -{axis}"
            );
            beads.report.note(&what, 0);
        }
        let machine = &mut beads.report.machine;
        machine.dialect = self.dialect.clone();
        machine.height = self.layer_axis.formula();
        machine.unit_source = self.unit.1;
    }

    /// The machine's state before its program begins.
    pub(super) fn setup(&self, options: &GcodeOptions, survey: &FileSurvey) -> Setup {
        let switch = match options.deposit_on.is_empty() {
            true => DepositionSwitch::of(self.family),
            false => DepositionSwitch::new(&options.deposit_on, &options.deposit_off),
        };
        Setup {
            by_extruder: self.by_extruder,
            switch,
            unit: self.unit.0,
            layer_axis: self.layer_axis,
            has_regions: survey.signs.has_regions,
        }
    }
}
