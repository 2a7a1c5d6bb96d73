//! What the user types for what analyses find, in pictures.

use crate::distance_args::{AlignArg, MeasureArg, angle};
use crate::kinds::typed;
use crate::picture_args::StyleArg;
use crate::units::Length;
use crate::void_args::not_negative;
use brickfield_engine::voids::Class;
use clap::{Args, ValueEnum};
use std::path::PathBuf;
use std::str::FromStr;

/// What an analysis finds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Finding {
    /// Voids, each in a colour
    Voids,
    /// How thick walls are, or how wide gaps
    Thickness,
    /// How far the surface is from a reference
    Deviation,
    /// What is new since an earlier store
    #[value(skip)]
    Changes,
}

impl Finding {
    /// By their names as styles.
    pub const NAMED: [(&'static str, Finding); 4] = [
        ("voids", Finding::Voids),
        ("thickness", Finding::Thickness),
        ("deviation", Finding::Deviation),
        ("changes", Finding::Changes),
    ];

    /// The one of a name.
    pub fn named(name: &str) -> Option<Finding> {
        Finding::NAMED.into_iter().find(|(named, _)| *named == name).map(|(_, finding)| finding)
    }

    /// Its name as a style.
    pub fn name(self) -> &'static str {
        Finding::NAMED.into_iter().find(|(_, finding)| *finding == self).map_or("", |(name, _)| name)
    }
}

/// What a picture in space shows.
#[derive(Clone, Debug)]
pub enum ShownArg {
    /// w.
    Style(StyleArg),
    /// What an analysis finds.
    Finding(Finding),
}

impl ShownArg {
    /// What is found, if it shows that.
    pub fn finding(&self) -> Option<Finding> {
        match self {
            ShownArg::Finding(finding) => Some(*finding),
            ShownArg::Style(_) => None,
        }
    }
}

impl FromStr for ShownArg {
    type Err = String;

    fn from_str(text: &str) -> Result<ShownArg, String> {
        if let Some(finding) = Finding::named(text) {
            return Ok(ShownArg::Finding(finding));
        }
        let names = Finding::NAMED.map(|(name, _)| name).join(", ");
        let style = text.parse().map(ShownArg::Style);
        style.map_err(|error: String| format!("{error}; {names} show what is found"))
    }
}

/// What decides the colours of voids.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ColourByArg {
    /// What they are taken for
    Class,
    /// How large they are, by their equivalent diameters
    Size,
}

/// What a void is taken for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ClassArg {
    Pocket,
    Infill,
    Flaw,
}

impl From<ClassArg> for Class {
    fn from(class: ClassArg) -> Class {
        match class {
            ClassArg::Pocket => Class::Pocket,
            ClassArg::Infill => Class::Infill,
            ClassArg::Flaw => Class::Flaw,
        }
    }
}

/// Options of `--style voids`, `thickness`, `deviation` and `changes`.
#[derive(Args)]
#[command(next_help_heading = "What is found")]
pub struct FindingArgs {
    /// Of voids: what decides their colours; the class by default, where the store tells it
    #[arg(long, value_enum)]
    pub colour_by: Option<ColourByArg>,
    /// Of voids: colour those of some classes alone, as in pocket,flaw
    #[arg(long, value_enum, value_name = "CLASS", value_delimiter = ',')]
    pub classes: Vec<ClassArg>,
    /// Of voids: leave out smaller ones, in the cube of the store's unit
    #[arg(long, value_name = "VOLUME", value_parser = not_negative)]
    pub min_volume: Option<f64>,
    /// Of voids: also those that open to the outside only through throats narrower than this, as in `voids`
    #[arg(long, value_name = "LEN")]
    pub closing: Option<Length>,
    /// Of voids: the CAD part on the same lattice, which tells their classes, as in `voids`
    #[arg(long, value_name = "CAD.brf")]
    pub cad: Option<PathBuf>,
    /// Of thickness: what it is, as in `thickness` [default: sphere]
    #[arg(long = "method", value_enum)]
    pub measure: Option<MeasureArg>,
    /// Of thickness: surface turned by less than this does not bound balls, as in `thickness` [default: 100]
    #[arg(long, value_name = "ANGLE", value_parser = angle)]
    pub separation: Option<f64>,
    /// Of thickness: gaps outside of the part instead of walls
    #[arg(long)]
    pub gaps: bool,
    /// Of thickness: colour what is thinner than this alone, as in 0.8mm
    #[arg(long, value_name = "LEN")]
    pub below: Option<Length>,
    /// Of thickness and deviation: where the colours end, as in 2mm; by default where 98 of 100 points of the surface are within
    #[arg(long, value_name = "LEN", conflicts_with = "below")]
    pub range: Option<Length>,
    /// Of deviation: what the part should be or is, a mesh, a store, or measured points
    #[arg(long, value_name = "REFERENCE")]
    pub reference: Option<PathBuf>,
    /// Of deviation: what is allowed to either side, in one colour, as in 0.2mm
    #[arg(long = "within", id = "allowed", value_name = "LEN")]
    pub within: Option<Length>,
    /// Of deviation: how the part is laid over the reference, as in `deviation` [default: none]
    #[arg(long, value_enum)]
    pub align: Option<AlignArg>,
    /// Of changes: the store as it was before `csg` or `machine`, on the same lattice
    #[arg(long, value_name = "PART.brf")]
    pub before: Option<PathBuf>,
    /// Folder of a temporary file for what of surfaces does not fit into memory; the output's own by default
    #[arg(long, value_name = "DIR")]
    pub temp_dir: Option<PathBuf>,
}

impl FindingArgs {
    /// Options that were given and belong to one kind of finding, with it.
    pub fn given(&self) -> impl Iterator<Item = (&'static str, Finding)> {
        use Finding::{Changes, Deviation, Thickness, Voids};
        let all = [
            (self.colour_by.is_some(), "--colour-by", Voids),
            (!self.classes.is_empty(), "--classes", Voids),
            (self.min_volume.is_some(), "--min-volume", Voids),
            (self.closing.is_some(), "--closing", Voids),
            (self.cad.is_some(), "--cad", Voids),
            (self.measure.is_some(), "--method", Thickness),
            (self.separation.is_some(), "--separation", Thickness),
            (self.gaps, "--gaps", Thickness),
            (self.below.is_some(), "--below", Thickness),
            (self.reference.is_some(), "--reference", Deviation),
            (self.within.is_some(), "--within", Deviation),
            (self.align.is_some(), "--align", Deviation),
            (self.before.is_some(), "--before", Changes),
        ];
        all.into_iter().filter(|(is_given, ..)| *is_given).map(|(_, option, finding)| (option, finding))
    }

    /// All that were given but for the folder, as a shell takes them, with a space before each.
    #[cfg_attr(not(feature = "view"), allow(dead_code))]
    pub fn options(&self) -> String {
        let length = |length: Option<Length>| length.map(|length| length.to_string());
        let file = |path: &Option<PathBuf>| path.as_ref().map(|path| typed(path));
        let classes: Vec<String> = self.classes.iter().filter_map(|class| name(*class)).collect();
        let all = [
            ("--colour-by", self.colour_by.and_then(name)),
            ("--classes", (!classes.is_empty()).then(|| classes.join(","))),
            ("--min-volume", self.min_volume.map(|volume| volume.to_string())),
            ("--closing", length(self.closing)),
            ("--cad", file(&self.cad)),
            ("--method", self.measure.and_then(name)),
            ("--separation", self.separation.map(|degrees| degrees.to_string())),
            ("--below", length(self.below)),
            ("--range", length(self.range)),
            ("--reference", file(&self.reference)),
            ("--within", length(self.within)),
            ("--align", self.align.and_then(name)),
            ("--before", file(&self.before)),
        ];
        let given = all.into_iter().filter_map(|(option, value)| Some(format!(" {option} {}", value?)));
        let gaps = self.gaps.then(|| " --gaps".to_owned());
        given.chain(gaps).collect()
    }
}

/// A choice as it is typed.
fn name(choice: impl ValueEnum) -> Option<String> {
    choice.to_possible_value().map(|value| value.get_name().to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_typed_can_be_typed_again() {
        #[derive(clap::Parser)]
        struct Typed {
            #[command(flatten)]
            finding: FindingArgs,
        }
        let typed = " --colour-by size --classes pocket,flaw --min-volume 0.5 --closing 0.4mm --cad 'a cad.brf' \
                     --method ray --separation 60 --below 0.8 --reference part.stl --within 100um --align shift \
                     --before old.brf --gaps";
        let words = typed.replace("a cad", "a_cad").replace('\'', "");
        let words = words.split(' ').map(|word| word.replace("a_cad", "a cad"));
        let args = <Typed as clap::Parser>::try_parse_from(words).expect("all are options");
        assert_eq!(args.finding.options(), typed);
    }

    #[test]
    fn findings_are_styles_of_their_own() {
        assert!(matches!("voids".parse(), Ok(ShownArg::Finding(Finding::Voids))));
        assert!(matches!("solid".parse(), Ok(ShownArg::Style(StyleArg::Named(_)))));
        assert!(matches!("a.toml".parse(), Ok(ShownArg::Style(StyleArg::File(_)))));
        let error = "nonsense".parse::<ShownArg>().unwrap_err();
        assert!(["voids", "deviation", "solid", ".toml"].iter().all(|name| error.contains(name)), "{error}");
    }
}
