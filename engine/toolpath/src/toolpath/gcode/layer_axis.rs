//! The axis that carries layers where it is not Z alone: a table that goes down, or a second vertical axis.

use crate::error::{Error, Result};
use std::fmt;
use std::str::FromStr;

/// An axis whose position counts into the height of the tool above the part.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LayerAxis {
    /// X to Z and the turning axes have letters, too; `None` for a file in which Z alone counts.
    letter: Option<u8>,
    /// Whether the part goes down with it as its position falls: its position is taken off.
    falls: bool,
}

impl LayerAxis {
    /// Z alone.
    pub const NONE: LayerAxis = LayerAxis { letter: None, falls: false };

    pub(super) const fn new(letter: u8, falls: bool) -> LayerAxis {
        LayerAxis { letter: Some(letter), falls }
    }

    pub(super) fn letter(self) -> Option<u8> {
        self.letter
    }

    /// The factor of its position in the height.
    pub(super) fn factor(self) -> f64 {
        if self.falls { -1.0 } else { 1.0 }
    }

    /// How the height comes about, as a formula.
    pub(super) fn formula(self) -> String {
        let sign = if self.falls { "-" } else { "+" };
        match self.letter {
            None => "Z".to_owned(),
            Some(b'Z') => if self.falls { "-Z" } else { "Z" }.to_owned(),
            Some(letter) => format!("Z {sign} {}", char::from(letter)),
        }
    }
}

impl fmt::Display for LayerAxis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.letter {
            None => f.write_str("none"),
            Some(letter) => write!(f, "{}{}", if self.falls { "-" } else { "" }, char::from(letter)),
        }
    }
}

impl FromStr for LayerAxis {
    type Err = Error;

    /// A letter, with a minus sign if its position is to be taken off: `W`, `-W`, `-Z`; or `none`.
    fn from_str(text: &str) -> Result<LayerAxis> {
        let upper = text.trim().to_ascii_uppercase();
        let (falls, name) = match upper.strip_prefix('-') {
            Some(name) => (true, name),
            None => (false, upper.strip_prefix('+').unwrap_or(&upper)),
        };
        match name.as_bytes() {
            b"NONE" if !falls => Ok(LayerAxis::NONE),
            [letter @ (b'A'..=b'C' | b'U'..=b'W' | b'Z')] => Ok(LayerAxis::new(*letter, falls)),
            _ => {
                let what = format!("\"{}\" is no axis that can carry layers", text.escape_debug());
                Err(Error::setting(what, "give W, -W (a table), another of U, V, W, A, B, C, -Z, or none"))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_are_typed_with_their_sign() {
        for (text, shown, formula) in [
            ("W", "W", "Z + W"),
            ("-w", "-W", "Z - W"),
            ("+U", "U", "Z + U"),
            ("-Z", "-Z", "-Z"),
            ("None", "none", "Z"),
        ] {
            let axis: LayerAxis = text.parse().unwrap();
            assert_eq!((axis.to_string(), axis.formula()), (shown.to_owned(), formula.to_owned()));
        }
        for text in ["", "X", "WW", "--W", "-none", "5", "E"] {
            assert!(text.parse::<LayerAxis>().is_err(), "{text}");
        }
    }
}
