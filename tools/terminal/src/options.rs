//! Options in place of the settings that the library's messages name.
//!
//! The library knows nothing of command lines: its messages name a setting as code, as in "allow more with `memory`".

use brickfield_engine::Error;

/// Settings that messages of the library name; each is set by the option of the same name.
const SETTINGS: [&str; 43] = [
    "backend",
    "boundary_error",
    "cell",
    "close",
    "closing",
    "deposit_off",
    "deposit_on",
    "depth",
    "detail",
    "device",
    "error",
    "estimate_normals",
    "extruder_axis",
    "firmware",
    "gwn_error",
    "height",
    "layer_axis",
    "level",
    "like",
    "max_depth",
    "memory",
    "method",
    "min_volume",
    "number",
    "pixel",
    "plate",
    "radius",
    "restart",
    "shard",
    "side",
    "sides",
    "size",
    "stddev",
    "supersample",
    "temp_dir",
    "thin",
    "threshold",
    "tolerance",
    "tool",
    "unit",
    "variable",
    "volume_as",
    "width",
];

/// What is set by an option of another command, with that command.
const ELSEWHERE: [(&str, &str); 1] = [("contour::tolerance", "`mesh --tolerance`")];

/// A message of the library with options in place of settings.
pub fn with_options(message: &str) -> String {
    let mut pieces = message.split('`');
    let mut text = pieces.next().unwrap_or_default().to_owned();
    // Every other piece is code, unless its end is missing.
    while let Some(code) = pieces.next() {
        let Some(after) = pieces.next() else {
            text.push('`');
            text.push_str(code);
            break;
        };
        match ELSEWHERE.iter().find(|(setting, _)| *setting == code) {
            Some((_, option)) => text.push_str(option),
            None if SETTINGS.contains(&code) => text.push_str(&format!("--{}", code.replace('_', "-"))),
            None => text.push_str(&format!("`{code}`")),
        }
        text.push_str(after);
    }
    text
}

/// The text of an error with options in place of settings. Names of files stay as they are.
pub fn error_with_options(error: Error) -> String {
    let named = |(what, remedy): (String, String)| (with_options(&what), with_options(&remedy));
    match error {
        Error::Input { path, place, what, remedy } => {
            let (what, remedy) = named((what, remedy));
            Error::Input { path, place, what, remedy }.to_string()
        }
        Error::Store { path, place, what, remedy } => {
            let (what, remedy) = named((what, remedy));
            Error::Store { path, place, what, remedy }.to_string()
        }
        Error::Setting { .. } | Error::Distrusted { .. } => with_options(&error.to_string()),
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_become_options_and_other_code_stays() {
        for (message, expected) in [
            (
                "allow more with `memory`, or close the surface",
                "allow more with --memory, or close the surface",
            ),
            ("choose another folder with `temp_dir`", "choose another folder with --temp-dir"),
            ("`cell` 0.2mm keeps them", "--cell 0.2mm keeps them"),
            (
                "leave `boundary_error` out; `contour::tolerance` merges",
                "leave --boundary-error out; `mesh --tolerance` merges",
            ),
            ("check it with `brickfield verify`", "check it with `brickfield verify`"),
            ("a lone ` and `memory", "a lone ` and `memory"),
            ("nothing", "nothing"),
        ] {
            assert_eq!(with_options(message), expected);
        }
    }

    #[test]
    fn file_names_stay_as_they_are() {
        let error = Error::input("a `memory` b.stl".as_ref(), "file", "is large", "allow more `memory`");
        assert_eq!(error_with_options(error), "a `memory` b.stl: file: is large; allow more --memory");
    }
}
