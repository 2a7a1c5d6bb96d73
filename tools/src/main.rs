//! The program `brickfield`.

#![forbid(unsafe_code)]

use std::process::ExitCode;

fn main() -> ExitCode {
    brickfield_program::main(std::env::args_os())
}
