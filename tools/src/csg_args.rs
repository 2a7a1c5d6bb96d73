//! What the user types for Booleans.

use crate::args::IoArg;
use crate::units::Size;
use crate::work::WorkArgs;
use brickfield_engine::csg::Operation;
use clap::{Arg, ArgAction, ArgMatches, Args, Command, FromArgMatches};
use std::path::PathBuf;

/// Join, take off and intersect stores, meshes, toolpaths and simple bodies: a new store
#[derive(Args)]
#[command(after_help = "\
Operands are taken from left to right as typed. Their samples are clamped to 0 and 1 first. A sample of the result is what \
the operands' samples make of it, exactly; a crossing is one of an operand's, bit by bit.

An operand is a store on the same lattice, built with `build --like A.brf`. A mesh or a toolpath is built so for the time of \
the command. Bodies need no file, their numbers take units:

  z>20mm                        all above a plane, also x and y, and <
  box 0,0,0,10,10,5             least coordinates, then greatest
  cylinder 31,31,r15mm,z        its centre across the axis, radius, axis; two more numbers are its ends
  sphere 5,5,5,r2               its centre, its radius

Where two surfaces pass between two samples and no sample lies between them, what is there is lost, as in any store. The \
summary counts such edges.

A result that is interrupted or killed leaves OUT.brf.part. The same command goes on from there, to the same bytes.

Examples:
  brickfield csg a.brf --minus b.brf -o out.brf
  brickfield csg a.brf --plus b.brf --minus 'cylinder 31,31,r5mm,z' --and 'z<20mm' -o out.brf")]
pub struct CsgArgs {
    /// The store to begin with
    #[arg(value_name = "A.brf")]
    pub store: PathBuf,
    #[command(flatten)]
    pub chain: ChainArgs,
    /// The store to write
    #[arg(long, short, value_name = "OUT.brf")]
    pub output: PathBuf,
    /// Keep the counts of the first store where it remains, in place of 1
    #[arg(long)]
    pub keep_counts: bool,
    #[command(flatten)]
    pub keeping: CommitArgs,
    /// How to read the stores
    #[arg(long, value_enum, default_value_t)]
    pub io: IoArg,
    /// Print the summary as JSON
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub work: WorkArgs,
}

/// How a store is written that a later run can go on with.
#[derive(Args)]
pub struct CommitArgs {
    /// Memory to stay within, as in 512MiB
    #[arg(long, value_name = "SIZE", default_value = "1GiB")]
    pub memory: Size,
    /// Seconds after which what there is of the store is made safe, again and again: what a crash may cost
    #[arg(long, value_name = "SECONDS", default_value_t = 10.0)]
    pub commit_every: f64,
    /// Begin anew, whatever an unfinished store of that name holds
    #[arg(long)]
    pub restart: bool,
}

/// Operands with their operations, in the order in which they were typed.
#[derive(Clone, Debug, Default)]
pub struct ChainArgs(pub Vec<(Operation, String)>);

/// Options that take an operand.
const OPTIONS: [(&str, Operation, &str); 3] = [
    ("plus", Operation::Plus, "Join with this, too"),
    ("minus", Operation::Minus, "Take this off"),
    ("and", Operation::And, "Keep only what is in this, too"),
];

impl Args for ChainArgs {
    fn augment_args(command: Command) -> Command {
        OPTIONS.iter().fold(command, |command, (name, _, help)| {
            let arg = Arg::new(*name).long(*name).value_name("OPERAND").help(*help);
            command.arg(arg.action(ArgAction::Append))
        })
    }

    fn augment_args_for_update(command: Command) -> Command {
        ChainArgs::augment_args(command)
    }
}

impl FromArgMatches for ChainArgs {
    fn from_arg_matches(matches: &ArgMatches) -> Result<ChainArgs, clap::Error> {
        let mut typed = Vec::new();
        for (name, operation, _) in OPTIONS {
            let places = matches.indices_of(name).into_iter().flatten();
            let values = matches.get_many::<String>(name).into_iter().flatten();
            typed.extend(places.zip(values).map(|(place, value)| (place, operation, value.clone())));
        }
        typed.sort_by_key(|(place, ..)| *place);
        Ok(ChainArgs(typed.into_iter().map(|(_, operation, value)| (operation, value)).collect()))
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        *self = ChainArgs::from_arg_matches(matches)?;
        Ok(())
    }
}
