//! What the user types for completions and manual pages.

use clap::Args;

/// Print a completion script for a shell
#[derive(Args)]
#[command(after_help = "Examples:
  brickfield completions bash > ~/.local/share/bash-completion/completions/brickfield")]
pub struct CompletionsArgs {
    /// The shell
    #[arg(value_enum)]
    pub shell: clap_complete::Shell,
}

/// Print a manual page
#[derive(Args)]
#[command(after_help = "Examples:
  brickfield man build | man -l -")]
pub struct ManArgs {
    /// The command to describe, as in `cache merge`; the program as a whole by default
    #[arg(value_name = "COMMAND")]
    pub command: Vec<String>,
}
