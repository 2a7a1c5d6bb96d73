//! Tools: what turns about an axis, from the tip upward.

use std::fmt;
use std::str::FromStr;

/// The form of a tool; lengths in mm, angles in degrees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ToolKind {
    /// A ball-end mill.
    Ball,
    /// A flat end mill.
    Flat,
    /// A bull-nose mill: flat with a rounded corner.
    Bull {
        /// Radius of the corner.
        corner: f64,
    },
    /// A drill with a cone for a tip.
    Drill {
        /// The tip's whole angle.
        angle: f64,
    },
    /// A chamfer mill: a cone with a flat tip.
    Chamfer {
        /// The cone's whole angle.
        angle: f64,
        /// Diameter of the tip.
        tip: f64,
    },
}

/// A tool.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tool {
    /// Its form.
    pub kind: ToolKind,
    /// Diameter in mm.
    pub diameter: f64,
    /// How far it reaches from its tip upward, in mm; without it leaves the part.
    pub length: Option<f64>,
}

/// Angle of a drill's tip that is not told.
const DRILL_ANGLE: f64 = 118.0;
/// Angle of a chamfer mill that is not told.
const CHAMFER_ANGLE: f64 = 90.0;

impl Tool {
    /// A tool of a form by its name, with the numbers that follow its diameter.
    ///
    /// # Errors
    /// What is wrong with them.
    pub fn new(name: &str, diameter: f64, more: &[f64], length: Option<f64>) -> Result<Tool, String> {
        let kind = match (name, more) {
            ("ball", []) => ToolKind::Ball,
            ("flat", []) => ToolKind::Flat,
            ("bull", [corner]) => ToolKind::Bull { corner: *corner },
            ("bull", _) => {
                return Err(
                    "a bull-nose mill has a diameter and a corner radius, as in bull:10mm,1mm".to_owned()
                );
            }
            ("drill", []) => ToolKind::Drill { angle: DRILL_ANGLE },
            ("drill", [angle]) => ToolKind::Drill { angle: *angle },
            ("chamfer", []) => ToolKind::Chamfer { angle: CHAMFER_ANGLE, tip: 0.0 },
            ("chamfer", [angle]) => ToolKind::Chamfer { angle: *angle, tip: 0.0 },
            ("chamfer", [angle, tip]) => ToolKind::Chamfer { angle: *angle, tip: *tip },
            ("ball" | "flat" | "chamfer", _) => return Err(format!("{name} has too many numbers")),
            _ => {
                return Err(format!(
                    "no tool \"{name}\"; use ball:D, flat:D, bull:D,CORNER, drill:D,ANGLE or chamfer:D,ANGLE,TIP"
                ));
            }
        };
        Tool { kind, diameter, length }.checked()
    }

    fn checked(self) -> Result<Tool, String> {
        let is_length = |value: f64| value > 0.0 && value < 1e5;
        if !is_length(self.diameter) || !self.length.is_none_or(is_length) {
            return Err("a tool's diameter and length must be above 0 and below 100 m".to_owned());
        }
        match self.kind {
            ToolKind::Bull { corner } if !(corner > 0.0 && corner <= self.diameter / 2.0) => {
                Err("a corner radius must be above 0 and at most half the diameter".to_owned())
            }
            ToolKind::Drill { angle } | ToolKind::Chamfer { angle, .. } if !(1.0..180.0).contains(&angle) => {
                Err("the angle of a tip must be from 1 to less than 180 degrees".to_owned())
            }
            ToolKind::Chamfer { tip, .. } if !(tip >= 0.0 && tip < self.diameter) => {
                Err("the tip of a chamfer mill must be less wide than the mill".to_owned())
            }
            _ => Ok(self),
        }
    }

    /// What a comment of a CAM program says of a tool, as in `T1 D=6. CR=3. - ball end mill`: its number and the tool; lengths
    /// times `unit` are mm. `None` if it says none.
    pub fn of_comment(comment: &str, unit: f64) -> Option<(u32, Tool)> {
        let text = comment.trim().to_ascii_lowercase();
        let digits = text.strip_prefix('t')?;
        let end = digits.find(|c: char| !c.is_ascii_digit()).unwrap_or(digits.len());
        let number = digits[..end].parse().ok()?;
        let value = |key: &str| {
            let at = text.find(key)? + key.len();
            let rest = &text[at..];
            let end =
                rest.find(|c: char| !(c.is_ascii_digit() || c == '.' || c == '-')).unwrap_or(rest.len());
            rest[..end].trim_end_matches('.').parse::<f64>().ok()
        };
        let diameter = value(" d=")? * unit;
        let corner = value("cr=").map_or(0.0, |corner| corner * unit);
        let angle = value("taper=").or(value("angle="));
        let tool = if text.contains("ball") {
            Tool::new("ball", diameter, &[], None)
        } else if text.contains("bull") && corner > 0.0 {
            Tool::new("bull", diameter, &[corner], None)
        } else if text.contains("drill") {
            Tool::new("drill", diameter, angle.as_slice(), None)
        } else if text.contains("chamfer") {
            Tool::new("chamfer", diameter, angle.map(|angle| 2.0 * angle).as_slice(), None)
        } else if corner > 0.0 && corner * 2.0 >= diameter {
            Tool::new("ball", diameter, &[], None)
        } else if corner > 0.0 {
            Tool::new("bull", diameter, &[corner], None)
        } else if text.contains("flat") || text.contains("end mill") || text.contains("face mill") {
            Tool::new("flat", diameter, &[], None)
        } else {
            return None;
        };
        Some((number, tool.ok()?))
    }
}

impl FromStr for Tool {
    type Err = String;

    /// As in `bull:10,1,length=40`, in mm.
    fn from_str(text: &str) -> Result<Tool, String> {
        let (name, numbers) = text
            .split_once(':')
            .ok_or_else(|| format!("{text}: expected a form and its sizes, as in ball:6mm"))?;
        let (mut sizes, mut length) = (Vec::new(), None);
        for part in numbers.split(',').map(str::trim) {
            let (is_length, number) = match part.strip_prefix("length=") {
                Some(number) => (true, number),
                None => (false, part),
            };
            let millimetres = size(number).ok_or_else(|| format!("{part}: expected a number, as in 6mm"))?;
            if is_length { length = Some(millimetres) } else { sizes.push(millimetres) }
        }
        let (diameter, more) = sizes.split_first().ok_or("a tool has a diameter, as in ball:6mm")?;
        Tool::new(name.trim(), *diameter, more, length)
    }
}

/// A number with or without a unit, in mm; angles may have `deg`.
fn size(text: &str) -> Option<f64> {
    let units = [("deg", 1.0), ("um", 1e-3), ("mm", 1.0), ("cm", 10.0), ("in", 25.4), ("", 1.0)];
    let (number, factor) =
        units.into_iter().find_map(|(unit, factor)| Some((text.strip_suffix(unit)?, factor)))?;
    number.trim().parse::<f64>().ok().filter(|number| number.is_finite()).map(|number| number * factor)
}

impl fmt::Display for Tool {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let d = self.diameter;
        match self.kind {
            ToolKind::Ball => write!(f, "ball:{d}mm"),
            ToolKind::Flat => write!(f, "flat:{d}mm"),
            ToolKind::Bull { corner } => write!(f, "bull:{d}mm,{corner}mm"),
            ToolKind::Drill { angle } => write!(f, "drill:{d}mm,{angle}deg"),
            ToolKind::Chamfer { angle, tip } => write!(f, "chamfer:{d}mm,{angle}deg,{tip}mm"),
        }?;
        self.length.map_or(Ok(()), |length| write!(f, ",length={length}mm"))
    }
}
