//! Bodies that are typed in place of a file.

use crate::units::{Length, Position};
use brickfield_engine::Axis;
use brickfield_engine::csg::Primitive;

/// The body that a text stands for; `None` if it is the name of a file. Bare numbers are in the store's unit, which is named.
///
/// # Errors
/// What is wrong with a text that begins as a body does.
pub fn body(text: &str, unit: &str) -> Option<Result<Primitive, String>> {
    let text = text.trim();
    if let Some((name, side)) = text.split_once(['>', '<'])
        && let Some(axis) = axis(name)
    {
        let above = text.contains('>');
        let at = position(side, unit);
        return Some(at.map(|at| Primitive::HalfSpace { axis, above, at }));
    }
    let (kind, numbers) = text.split_once(' ')?;
    let parts: Vec<&str> = numbers.split(',').map(str::trim).collect();
    match kind {
        "box" => Some(block(&parts, unit)),
        "cylinder" => Some(cylinder(&parts, unit)),
        "sphere" => Some(sphere(&parts, unit)),
        _ => None,
    }
}

fn axis(name: &str) -> Option<Axis> {
    match name.trim() {
        "x" | "X" => Some(Axis::X),
        "y" | "Y" => Some(Axis::Y),
        "z" | "Z" => Some(Axis::Z),
        _ => None,
    }
}

fn position(text: &str, unit: &str) -> Result<f64, String> {
    let found: Position = text.trim().parse().map_err(|error| format!("{text}: {error}"))?;
    found.in_unit_of(unit).ok_or_else(|| format!("{text}: the store has no unit of length"))
}

fn radius(text: &str, unit: &str) -> Result<f64, String> {
    let number = text.strip_prefix(['r', 'R']).unwrap_or(text);
    let found: Length = number.parse().map_err(|error| format!("radius {text}: {error}"))?;
    found.in_unit_of(unit).ok_or_else(|| format!("{text}: the store has no unit of length"))
}

fn block(parts: &[&str], unit: &str) -> Result<Primitive, String> {
    let numbers: Vec<f64> = parts.iter().map(|part| position(part, unit)).collect::<Result<_, _>>()?;
    let [a, b, c, d, e, f] = numbers[..] else {
        return Err("a box has six numbers, as in `box 0,0,0,10,10,5`".to_owned());
    };
    Ok(Primitive::Box { min: [a, b, c], max: [d, e, f] })
}

fn cylinder(parts: &[&str], unit: &str) -> Result<Primitive, String> {
    let wrong = "a cylinder has a centre, a radius and an axis, as in `cylinder 31,31,r15mm,z`, and may have two ends";
    let (one, other, round, along, ends) = match parts {
        [one, other, round, along] => (one, other, round, along, None),
        [one, other, round, along, from, to] => (one, other, round, along, Some((from, to))),
        _ => return Err(wrong.to_owned()),
    };
    let axis = axis(along).ok_or_else(|| format!("{along}: {wrong}"))?;
    let centre = [position(one, unit)?, position(other, unit)?];
    let span = match ends {
        Some((from, to)) => Some((position(from, unit)?, position(to, unit)?)),
        None => None,
    };
    Ok(Primitive::Cylinder { axis, centre, radius: radius(round, unit)?, span })
}

fn sphere(parts: &[&str], unit: &str) -> Result<Primitive, String> {
    let [x, y, z, round] = parts else {
        return Err("a sphere has a centre and a radius, as in `sphere 5,5,5,r2`".to_owned());
    };
    let centre = [position(x, unit)?, position(y, unit)?, position(z, unit)?];
    Ok(Primitive::Sphere { centre, radius: radius(round, unit)? })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bodies_are_told_from_names() {
        let found = |text| body(text, "mm").map(Result::unwrap);
        assert_eq!(found("z>2cm"), Some(Primitive::HalfSpace { axis: Axis::Z, above: true, at: 20.0 }));
        assert_eq!(found("x < -1.5"), Some(Primitive::HalfSpace { axis: Axis::X, above: false, at: -1.5 }));
        let span = Some((0.0, 30.0));
        let hole = Primitive::Cylinder { axis: Axis::Z, centre: [31.0, 30.0], radius: 15.0, span };
        assert_eq!(found("cylinder 31, 30, r15mm, z, 0, 3cm"), Some(hole));
        let ball = Primitive::Sphere { centre: [1.0, 2.0, 3.0], radius: 4.0 };
        assert_eq!(found("sphere 1,2,3,4"), Some(ball));
        for name in ["part.brf", "my part.stl", "a>b.brf"] {
            assert_eq!(found(name), None);
        }
        for wrong in
            ["z>", "box 1,2,3", "cylinder 1,2,r3,w", "cylinder 1,2,r-3,z", "sphere 1,2,3", "z>4parsec"]
        {
            assert!(body(wrong, "mm").unwrap().is_err(), "{wrong}");
        }
    }
}
