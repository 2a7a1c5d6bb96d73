//! `brickfield completions` and `brickfield man`: what a package installs beside the program.

use crate::args::Cli;
use crate::failure::Failure;
use crate::shell_args::{CompletionsArgs, ManArgs};
use clap::CommandFactory;
use std::io::Write;

/// Prints a completion script.
pub fn completions(args: &CompletionsArgs) -> Result<(), Failure> {
    // Into memory first: the generator panics where writing fails.
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut Cli::command(), "brickfield", &mut script);
    write_all(&script)
}

/// Prints a manual page.
pub fn man(args: &ManArgs) -> Result<(), Failure> {
    let mut command = Cli::command();
    command.build();
    for name in &args.command {
        command = command.find_subcommand(name).cloned().ok_or_else(|| {
            let all = args.command.join(" ");
            Failure::Usage(format!("there is no command \"{all}\"; see brickfield --help"))
        })?;
    }
    let title = command.get_display_name().unwrap_or("brickfield").to_owned();
    let mut page = Vec::new();
    let source = concat!("brickfield ", env!("CARGO_PKG_VERSION"));
    let man = clap_mangen::Man::new(command).title(title).source(source).manual("User Commands");
    man.render(&mut page).map_err(Failure::stdout)?;
    write_all(&page)
}

fn write_all(bytes: &[u8]) -> Result<(), Failure> {
    let mut out = std::io::stdout().lock();
    out.write_all(bytes).and_then(|()| out.flush()).map_err(Failure::stdout)
}
