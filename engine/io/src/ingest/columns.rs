//! What the columns of a point cloud hold: by their names, or else by their numbers.

use serde::Serialize;

/// Lines by which columns without names are understood.
pub(super) const SAMPLE_ROWS: usize = 4096;
/// How far the length of a unit vector may be from 1: one of three components of one digit, 0.6 0.6 0.6, is off by 0.04.
const UNIT_ERROR: f64 = 0.05;
/// Share of vectors that must have length 1, of those that are not 0.
const UNIT_SHARE: f64 = 0.99;

/// What a column holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Column {
    Position(usize),
    Normal(usize),
    Colour(usize),
    Alpha,
    Intensity,
    Other,
}

/// The columns of a cloud, and what is known of its normals.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct CloudColumns {
    /// Names in the order of the file.
    pub names: Vec<String>,
    /// Whether the file names them; otherwise they are understood by their numbers.
    pub named: bool,
    /// Whether its numbers have commas for decimal points.
    pub decimal_commas: bool,
    /// Why there are no normals.
    pub no_normals: Option<String>,
    /// What else the user should know, a sentence each.
    pub notes: Vec<String>,
}

/// How a row becomes a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct ColumnLayout {
    pub(super) position: [usize; 3],
    pub(super) normal: Option<[usize; 3]>,
}

impl Column {
    /// By a name as programs write it: `X`, `nx`, `Normal_X`, `R`, `red`, `x [mm]`.
    pub(super) fn of_name(name: &[u8]) -> Column {
        let name = name.to_ascii_lowercase();
        let bare = name.split(|b| b"[(".contains(b)).next().unwrap_or_default();
        let bare: Vec<u8> = bare.iter().copied().filter(|b| !b"\"'_- \t".contains(b)).collect();
        match &bare[..] {
            b"x" | b"posx" | b"positionx" | b"px" => Column::Position(0),
            b"y" | b"posy" | b"positiony" | b"py" => Column::Position(1),
            b"z" | b"posz" | b"positionz" | b"pz" => Column::Position(2),
            b"nx" | b"normalx" => Column::Normal(0),
            b"ny" | b"normaly" => Column::Normal(1),
            b"nz" | b"normalz" => Column::Normal(2),
            b"r" | b"red" | b"rf" => Column::Colour(0),
            b"g" | b"green" | b"gf" => Column::Colour(1),
            b"b" | b"blue" | b"bf" => Column::Colour(2),
            b"a" | b"alpha" => Column::Alpha,
            b"i" | b"intensity" => Column::Intensity,
            _ => Column::Other,
        }
    }

    /// For people.
    pub(super) fn name(self) -> &'static str {
        match self {
            Column::Position(axis) => ["x", "y", "z"][axis],
            Column::Normal(axis) => ["nx", "ny", "nz"][axis],
            Column::Colour(part) => ["red", "green", "blue"][part],
            Column::Alpha => "alpha",
            Column::Intensity => "intensity",
            Column::Other => "?",
        }
    }
}

/// The layout of named columns; `None` unless there is just one of each coordinate.
pub(super) fn of_names(columns: &[Column]) -> Option<ColumnLayout> {
    let find = |wanted: Column| {
        let mut found = columns.iter().enumerate().filter(|(_, column)| **column == wanted);
        let at = found.next()?.0;
        found.next().is_none().then_some(at)
    };
    let three = |kind: fn(usize) -> Column| {
        let [x, y, z] = [0, 1, 2].map(|axis| find(kind(axis)));
        Some([x?, y?, z?])
    };
    Some(ColumnLayout { position: three(Column::Position)?, normal: three(Column::Normal) })
}

/// The columns of rows without names, each row of `width` numbers. `counted` says that the file begins with the number of
/// its points, as PTS does, where the intensity comes before the colours.
pub(super) fn of_numbers(
    rows: &[f64],
    width: usize,
    counted: bool,
) -> (Vec<Column>, ColumnLayout, Option<String>) {
    let mut columns = vec![Column::Other; width];
    (0..3).for_each(|axis| columns[axis] = Column::Position(axis));
    let position = [0, 1, 2];
    let offsets = || 3..(width + 1).saturating_sub(3).max(3);
    let vectors = |at: usize| rows.chunks_exact(width).map(move |row| [row[at], row[at + 1], row[at + 2]]);
    if let Some(at) = offsets().find(|&at| NormalLengths::of(vectors(at)).are_units()) {
        (0..3).for_each(|axis| columns[at + axis] = Column::Normal(axis));
        let is_free = |other: &usize| (*other + 3 <= at) || *other >= at + 3;
        if let Some(other) = offsets().filter(is_free).find(|&other| colours(vectors(other)).is_some()) {
            (0..3).for_each(|part| columns[other + part] = Column::Colour(part));
        }
        return (columns, ColumnLayout { position, normal: Some([at, at + 1, at + 2]) }, None);
    }
    let layout = ColumnLayout { position, normal: None };
    let first = if counted && width == 7 { 4 } else { 3 };
    let colours = offsets().filter(|at| *at >= first).find_map(|at| Some((at, colours(vectors(at))?)));
    let why = match colours {
        Some((at, what)) => {
            (0..3).for_each(|part| columns[at + part] = Column::Colour(part));
            format!("columns {} to {} look like colours, {what}", at + 1, at + 3)
        }
        None if width == 3 => "the lines hold x y z alone".to_owned(),
        None if width < 6 => format!("the lines hold x y z and {} more, too few for normals", width - 3),
        None => {
            let NormalLengths { min, max, .. } = NormalLengths::of(vectors(3));
            let lengths = format!("have lengths from {} to {}", short(min), short(max));
            format!("columns 4 to 6 {lengths}, so they are no unit vectors, nor are they colours")
        }
    };
    if columns.get(3) == Some(&Column::Other) && (width == 4 || matches!(colours, Some((4, _)))) {
        columns[3] = Column::Intensity;
    }
    (columns, layout, Some(why))
}

/// What kind of colours these are, if they may be colours.
fn colours(rows: impl Iterator<Item = [f64; 3]> + Clone) -> Option<&'static str> {
    let all = |test: fn(f64) -> bool| rows.clone().flatten().all(test);
    if all(|c| (0.0..=255.0).contains(&c) && c.fract() == 0.0) {
        Some("whole numbers from 0 to 255")
    } else if all(|c| (0.0..=1.0).contains(&c)) {
        Some("numbers from 0 to 1")
    } else if all(|c| (0.0..=65535.0).contains(&c) && c.fract() == 0.0) {
        Some("whole numbers from 0 to 65535")
    } else {
        None
    }
}

/// A number as it may stand in a sentence.
pub(super) fn short(value: f64) -> String {
    let text = format!("{value:.3}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

/// How long vectors are that may be normals.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct NormalLengths {
    /// How many.
    pub count: u64,
    /// Of these, those of length 0.
    pub zero: u64,
    /// Those of length 1, up to a twentieth.
    pub unit: u64,
    /// Those with a component that is not finite.
    #[serde(skip)]
    pub(super) bad: u64,
    /// Least and greatest length of those that are not 0.
    pub min: f64,
    /// See `min`.
    pub max: f64,
    /// Whether any component is below 0.
    #[serde(skip)]
    pub(super) negative: bool,
}

impl NormalLengths {
    /// Of no vectors.
    pub(super) const NONE: NormalLengths =
        NormalLengths { count: 0, zero: 0, unit: 0, bad: 0, min: f64::INFINITY, max: 0.0, negative: false };

    pub(super) fn of(vectors: impl Iterator<Item = [f64; 3]>) -> NormalLengths {
        let mut lengths = NormalLengths::NONE;
        vectors.for_each(|vector| lengths.add(vector));
        lengths
    }

    fn add(&mut self, vector: [f64; 3]) {
        let length = vector.iter().map(|c| c * c).sum::<f64>().sqrt();
        self.count += 1;
        self.negative |= vector.iter().any(|c| *c < 0.0);
        if !length.is_finite() {
            self.bad += 1;
        } else if length == 0.0 {
            self.zero += 1;
        } else {
            self.unit += u64::from((length - 1.0).abs() <= UNIT_ERROR);
            (self.min, self.max) = (self.min.min(length), self.max.max(length));
        }
    }

    /// Whether practically all have length 1; some may be missing, that is, 0.
    pub fn are_units(&self) -> bool {
        let present = self.count - self.zero - self.bad;
        self.unit as f64 >= UNIT_SHARE * present as f64 && 2 * self.zero <= self.count && self.count > 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn understood(rows: &[&[f64]]) -> (String, Option<usize>, String) {
        let (columns, layout, why) = of_numbers(&rows.concat(), rows[0].len(), false);
        let names: Vec<&str> = columns.iter().map(|column| column.name()).collect();
        (names.join(" "), layout.normal.map(|normal| normal[0]), why.unwrap_or_default())
    }

    #[test]
    fn normals_and_colours_are_told_apart() {
        for (rows, names, normal) in [
            (&[&[1.0, 2.0, 3.0][..]][..], "x y z", None),
            (&[&[1.0, 2.0, 3.0, 9.0]], "x y z intensity", None),
            (&[&[1.0, 2.0, 3.0, 0.0, 0.6, -0.8]], "x y z nx ny nz", Some(3)),
            (&[&[1.0, 2.0, 3.0, 200.0, 180.0, 90.0]], "x y z red green blue", None),
            (&[&[1.0, 2.0, 3.0, 0.0, 0.0, 0.0]], "x y z red green blue", None),
            (&[&[1.0, 2.0, 3.0, 0.8, 0.7, 0.9]], "x y z red green blue", None),
            (&[&[1.0, 2.0, 3.0, -40.0, 200.0, 180.0, 90.0]], "x y z intensity red green blue", None),
            (
                &[&[1.0, 2.0, 3.0, 200.0, 180.0, 90.0, 0.0, 0.0, 1.0]],
                "x y z red green blue nx ny nz",
                Some(6),
            ),
            (
                &[&[1.0, 2.0, 3.0, 0.0, 0.0, 1.0, 200.0, 180.0, 90.0]],
                "x y z nx ny nz red green blue",
                Some(3),
            ),
            (&[&[1.0, 2.0, 3.0, -5.0, 0.5, 3.0]], "x y z ? ? ?", None),
        ] {
            let (found, at, why) = understood(rows);
            assert_eq!((&found[..], at), (names, normal), "{rows:?}");
            assert_eq!(at.is_none(), !why.is_empty());
        }
        let grey = understood(&[&[1.0, 2.0, 3.0, -5.0, 0.5, 3.0], &[1.0, 2.0, 3.0, 1.0, 0.0, 0.0]]);
        assert!(grey.2.contains("lengths from 1 to 5.852"), "{}", grey.2);
    }

    #[test]
    fn names_are_known() {
        let of = |names: &str| {
            let columns: Vec<Column> =
                names.split(' ').map(|name| Column::of_name(name.as_bytes())).collect();
            of_names(&columns).map(|layout| (layout.position, layout.normal))
        };
        assert_eq!(of("X Y Z Nx Ny Nz"), Some(([0, 1, 2], Some([3, 4, 5]))));
        assert_eq!(of("id z[mm] \"y\" x(m) Normal_Z normal-y normalX"), Some(([3, 2, 1], Some([6, 5, 4]))));
        assert_eq!(of("x y z r g b"), Some(([0, 1, 2], None)));
        assert_eq!(of("x y z x"), None);
        assert_eq!(of("a scan"), None);
    }
}
