//! Lengths, sizes and other values as people type them.

use brickfield_engine::lattice::{MAX_LEVEL, NodeKey};
use brickfield_engine::store::ShardId;
use std::fmt;
use std::str::FromStr;

/// A unit of length.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Unit {
    /// Micrometre
    Um,
    /// Millimetre
    Mm,
    /// Centimetre
    Cm,
    /// Metre
    M,
    /// Thousandth of an inch
    Mil,
    /// Inch
    In,
    /// Foot
    Ft,
}

impl Unit {
    const ALL: [Unit; 7] = [Unit::Um, Unit::Mm, Unit::Cm, Unit::M, Unit::Mil, Unit::In, Unit::Ft];

    /// The unit's length in nanometres, which are whole for all of them.
    fn nanometres(self) -> f64 {
        match self {
            Unit::Um => 1e3,
            Unit::Mm => 1e6,
            Unit::Cm => 1e7,
            Unit::M => 1e9,
            Unit::Mil => 25_400.0,
            Unit::In => 25_400_000.0,
            Unit::Ft => 304_800_000.0,
        }
    }

    /// The unit's length in metres.
    pub fn metres(self) -> f64 {
        self.nanometres() / 1e9
    }

    /// The unit's length in millimetres.
    pub fn millimetres(self) -> f64 {
        self.nanometres() / 1e6
    }

    /// The unit that has this symbol.
    pub fn of_symbol(symbol: &str) -> Option<Unit> {
        Unit::ALL.into_iter().find(|unit| unit.symbol() == symbol)
    }

    /// As typed and as stored.
    pub fn symbol(self) -> &'static str {
        match self {
            Unit::Um => "um",
            Unit::Mm => "mm",
            Unit::Cm => "cm",
            Unit::M => "m",
            Unit::Mil => "mil",
            Unit::In => "in",
            Unit::Ft => "ft",
        }
    }
}

impl fmt::Display for Unit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.symbol())
    }
}

/// A positive length; without a unit it is in the input's own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Length {
    value: f64,
    unit: Option<Unit>,
}

impl Length {
    /// The number of `unit`s, the input's own.
    pub fn in_unit(self, unit: Unit) -> f64 {
        match self.unit {
            Some(own) if own != unit => self.value * own.nanometres() / unit.nanometres(),
            _ => self.value,
        }
    }

    /// The number of units that have this symbol, if it is one; `None` if the length has a unit and the symbol is
    /// unknown.
    pub fn in_unit_of(self, symbol: &str) -> Option<f64> {
        match Unit::of_symbol(symbol) {
            Some(unit) => Some(self.in_unit(unit)),
            None => self.unit.is_none().then_some(self.value),
        }
    }
}

impl fmt::Display for Length {
    /// As it may be typed.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}{}", self.value, self.unit.map_or("", Unit::symbol))
    }
}

/// A length that may be 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tolerance(Length);

impl Tolerance {
    /// In `unit`; a bare number is in that unit already.
    pub fn in_unit(self, unit: Unit) -> f64 {
        self.0.in_unit(unit)
    }

    /// As [`Length::in_unit_of`].
    pub fn in_unit_of(self, symbol: &str) -> Option<f64> {
        self.0.in_unit_of(symbol)
    }
}

impl FromStr for Tolerance {
    type Err = String;

    fn from_str(text: &str) -> Result<Tolerance, String> {
        parse_length(text, Sign::NotBelowZero).map(Tolerance)
    }
}

/// A coordinate: a length of either sign.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Position(Length);

impl Position {
    /// As [`Length::in_unit_of`].
    pub fn in_unit_of(self, symbol: &str) -> Option<f64> {
        self.0.in_unit_of(symbol)
    }
}

impl FromStr for Position {
    type Err = String;

    fn from_str(text: &str) -> Result<Position, String> {
        parse_length(text, Sign::Any).map(Position)
    }
}

impl FromStr for Length {
    type Err = String;

    fn from_str(text: &str) -> Result<Length, String> {
        parse_length(text, Sign::AboveZero)
    }
}

/// Which lengths are wanted.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Sign {
    AboveZero,
    NotBelowZero,
    Any,
}

fn parse_length(text: &str, sign: Sign) -> Result<Length, String> {
    let (number, suffix) = split(text);
    let unit = match suffix {
        "" => None,
        "µm" | "μm" => Some(Unit::Um),
        _ => match Unit::of_symbol(suffix) {
            Some(unit) => Some(unit),
            None => {
                return Err(format!("no unit \"{suffix}\"; use {}", Unit::ALL.map(Unit::symbol).join(", ")));
            }
        },
    };
    match number.parse::<f64>() {
        Ok(value) if !value.is_finite() => Err("a length must be a finite number".to_owned()),
        Ok(value) if value > 0.0 || sign == Sign::Any || sign == Sign::NotBelowZero && value == 0.0 => {
            Ok(Length { value, unit })
        }
        Ok(_) if sign == Sign::NotBelowZero => Err("a tolerance must not be below 0".to_owned()),
        Ok(_) => Err("a length must be above 0".to_owned()),
        Err(_) => Err("expected a number and a unit, as in 0.05mm".to_owned()),
    }
}

/// Which shard of how many, as in 2/4.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ShardArg(pub ShardId);

impl FromStr for ShardArg {
    type Err = String;

    fn from_str(text: &str) -> Result<ShardArg, String> {
        let numbers = text.split_once('/').and_then(|(i, n)| Some((i.parse().ok()?, n.parse().ok()?)));
        let (number, of) = numbers.ok_or("expected a shard and the number of shards, as in 2/4")?;
        let range =
            || format!("shards are numbered from 1 to their number, which is at most {}", ShardId::MAX);
        ShardId::new(number, of).map(ShardArg).ok_or_else(range)
    }
}

/// A point as x,y,z.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointArg(pub [f64; 3]);

impl FromStr for PointArg {
    type Err = String;

    fn from_str(text: &str) -> Result<PointArg, String> {
        numbers(text).map(PointArg).ok_or_else(|| "expected three numbers, as in 1,2.5,-3".to_owned())
    }
}

/// A box as x0,y0,z0,x1,y1,z1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoxArg {
    /// The least coordinates, then the greatest.
    pub corners: [[f64; 3]; 2],
}

impl FromStr for BoxArg {
    type Err = String;

    fn from_str(text: &str) -> Result<BoxArg, String> {
        let [x0, y0, z0, x1, y1, z1] =
            numbers(text).ok_or("expected six numbers, the least coordinates, then the greatest")?;
        let corners = [[x0, y0, z0], [x1, y1, z1]];
        match (0..3).all(|a| corners[0][a] <= corners[1][a]) {
            true => Ok(BoxArg { corners }),
            false => Err("the least coordinates must come first".to_owned()),
        }
    }
}

/// So many finite numbers between commas.
fn numbers<const N: usize>(text: &str) -> Option<[f64; N]> {
    let number = |part: &str| fast_float2::parse::<f64, _>(part.trim()).ok().filter(|v| v.is_finite());
    let numbers: Option<Vec<f64>> = text.split(',').map(number).collect();
    numbers?.try_into().ok()
}

/// A node of an octree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NodeArg(pub NodeKey);

impl FromStr for NodeArg {
    type Err = String;

    fn from_str(text: &str) -> Result<NodeArg, String> {
        let example = || "expected level:x,y,z as in 2:1,0,3, or a key".to_owned();
        let Some((level, position)) =
            text.trim_start_matches('L').trim_end_matches(')').split_once([':', '('])
        else {
            let key = text.parse().ok().and_then(NodeKey::from_code);
            return key.map(NodeArg).ok_or_else(example);
        };
        let position: Option<Vec<u32>> = position.split(',').map(|part| part.trim().parse().ok()).collect();
        let position: [u32; 3] = position.and_then(|p| p.try_into().ok()).ok_or_else(example)?;
        let level: u8 = level.parse().map_err(|_| example())?;
        let range =
            || format!("there is no such node: a level L, at most {MAX_LEVEL}, has 2^L bricks an axis");
        NodeKey::new(level, position).map(NodeArg).ok_or_else(range)
    }
}

/// A number of bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Size(pub u64);

impl Size {
    const UNITS: [(&'static str, u64); 10] = [
        ("KiB", 1 << 10),
        ("MiB", 1 << 20),
        ("GiB", 1 << 30),
        ("TiB", 1 << 40),
        ("kB", 1_000),
        ("KB", 1_000),
        ("MB", 1_000_000),
        ("GB", 1_000_000_000),
        ("TB", 1_000_000_000_000),
        ("B", 1),
    ];
}

impl FromStr for Size {
    type Err = String;

    fn from_str(text: &str) -> Result<Size, String> {
        let (number, suffix) = split(text);
        let unit = match suffix {
            "" => 1,
            _ => match Size::UNITS.into_iter().find(|(name, _)| *name == suffix) {
                Some((_, bytes)) => bytes,
                None => {
                    return Err(format!("no unit \"{suffix}\"; use KiB, MiB, GiB, TiB, kB, MB, GB or TB"));
                }
            },
        };
        match number.parse::<f64>() {
            Ok(value) if value > 0.0 && value * (unit as f64) < u64::MAX as f64 => {
                Ok(Size((value * unit as f64) as u64))
            }
            Ok(_) => Err("a size must be above 0 and below 16 EiB".to_owned()),
            Err(_) => Err("expected a number and a unit, as in 4GiB".to_owned()),
        }
    }
}

impl fmt::Display for Size {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let fits = |(_, unit): &&(&str, u64)| self.0 >= *unit;
        match Size::UNITS[..4].iter().rev().find(fits) {
            Some((name, unit)) => write!(f, "{:.1} {name}", self.0 as f64 / *unit as f64),
            None => write!(f, "{} B", self.0),
        }
    }
}

/// Splits a number from its unit. An "e" belongs to the number where a digit or a sign follows it.
fn split(text: &str) -> (&str, &str) {
    let text = text.trim();
    let bytes = text.as_bytes();
    let in_number = |(at, byte): (usize, &u8)| match byte {
        b'0'..=b'9' | b'.' | b'+' | b'-' => true,
        b'e' | b'E' => at > 0 && bytes.get(at + 1).is_some_and(|b| b.is_ascii_digit() || b"+-".contains(b)),
        _ => false,
    };
    let end = bytes.iter().enumerate().position(|item| !in_number(item)).unwrap_or(bytes.len());
    (&text[..end], text[end..].trim_start())
}

/// A bound on the error of winding numbers of open input.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GwnError(pub f64);

impl FromStr for GwnError {
    type Err = String;

    fn from_str(text: &str) -> Result<GwnError, String> {
        let value = fast_float2::parse(text).ok().filter(|v| (1e-6..=0.5).contains(v));
        value.map(GwnError).ok_or_else(|| "write a number from 1e-6 to 0.5".to_owned())
    }
}

impl fmt::Display for GwnError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_are_converted() {
        let mm = |text: &str| text.parse::<Length>().map(|length| length.in_unit(Unit::Mm));
        assert_eq!(mm("0.05mm"), Ok(0.05));
        assert_eq!(mm("2um"), Ok(0.002));
        assert_eq!(mm("2 µm"), Ok(0.002));
        assert_eq!(mm("0.1in"), Ok(2.54));
        assert_eq!(mm("1cm"), Ok(10.0));
        assert_eq!(mm("0.3m"), Ok(300.0));
        assert_eq!(mm("1e-3m"), Ok(1.0));
        assert_eq!(mm("0.25"), Ok(0.25));
        assert_eq!("0.25".parse::<Length>().unwrap().in_unit(Unit::In), 0.25);
        assert_eq!("25.4mm".parse::<Length>().unwrap().in_unit(Unit::In), 1.0);
        for bad in ["", "mm", "-1mm", "0", "nan", "inf", "1e999", "1 parsec", "1,5mm", "1mm2"] {
            assert!(bad.parse::<Length>().is_err(), "{bad}");
        }
    }

    #[test]
    fn coordinates_have_signs() {
        let mm = |text: &str| text.parse::<Position>().map(|at| at.in_unit_of("mm"));
        assert_eq!(mm("-0.1in"), Ok(Some(-2.54)));
        assert_eq!(mm("0"), Ok(Some(0.0)));
        assert_eq!("-2mm".parse::<Position>().unwrap().in_unit_of("parsec"), None);
        assert_eq!("-2".parse::<Position>().unwrap().in_unit_of("parsec"), Some(-2.0));
        assert!("-inf".parse::<Position>().is_err() && "-1".parse::<Tolerance>().is_err());
    }

    #[test]
    fn nodes_and_boxes_are_read() {
        let key = NodeKey::new(2, [1, 0, 3]).unwrap();
        for text in ["2:1,0,3", "L2(1,0,3)", &key.to_string(), &key.code().to_string(), "2: 1, 0, 3"] {
            assert_eq!(text.parse(), Ok(NodeArg(key)), "{text}");
        }
        for bad in
            ["", "L", "2:1,0", "2:1,0,4", "17:0,0,0", "300:0,0,0", "0", "2", "-1", "2:1,0,3,4", "a:b,c,d"]
        {
            assert!(bad.parse::<NodeArg>().is_err(), "{bad}");
        }
        let corners = [[0.0, -1.0, 2.0], [1.5, 1.0, 2.0]];
        assert_eq!("0,-1,2,1.5,1,2".parse(), Ok(BoxArg { corners }));
        for bad in ["", "1,2,3", "0,0,0,1,1,-1", "0,0,0,1,1,nan", "0,0,0,1,1,1,1"] {
            assert!(bad.parse::<BoxArg>().is_err(), "{bad}");
        }
        assert_eq!("1, -2,3e1".parse(), Ok(PointArg([1.0, -2.0, 30.0])));
        assert!("1,2".parse::<PointArg>().is_err());
    }

    #[test]
    fn sizes_are_read_and_written() {
        let bytes = |text: &str| text.parse::<Size>().map(|size| size.0);
        assert_eq!(bytes("512KiB"), Ok(512 << 10));
        assert_eq!((bytes("10kB"), bytes("10KB")), (Ok(10_000), Ok(10_000)));
        assert_eq!(bytes("4GiB"), Ok(4 << 30));
        assert_eq!(bytes("1.5 MiB"), Ok(3 << 19));
        assert_eq!(bytes("2GB"), Ok(2_000_000_000));
        assert_eq!(bytes("123"), Ok(123));
        for bad in ["", "0", "-1GiB", "4gigs", "GiB", "1e30GiB"] {
            assert!(bad.parse::<Size>().is_err(), "{bad}");
        }
        assert_eq!(Size(1536).to_string(), "1.5 KiB");
        assert_eq!(Size(7).to_string(), "7 B");
    }
}
