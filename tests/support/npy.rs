//! A reader for the arrays that the program writes.

use std::path::Path;

/// A cube of numbers indexed [z][y][x].
pub struct Array {
    pub descr: String,
    pub axis: usize,
    pub values: Vec<f64>,
}

impl Array {
    /// Reads NumPy's format, version 1.0.
    pub fn read(path: &Path) -> Array {
        let bytes = std::fs::read(path).expect("the array is there");
        assert_eq!(&bytes[..8], b"\x93NUMPY\x01\x00");
        let header_end = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
        assert_eq!(header_end % 64, 0);
        let header = std::str::from_utf8(&bytes[10..header_end]).expect("the header is text");
        assert!(header.ends_with('\n') && header.contains("'fortran_order': False"), "{header}");
        let after = |key: &str| header.split(key).nth(1).expect("the key is there");
        let descr = after("'descr': '").split('\'').next().expect("it is quoted").to_owned();
        let shape = after("'shape': (").split(')').next().expect("it is a tuple");
        let shape: Vec<usize> = shape.split(", ").map(|n| n.parse().expect("a number")).collect();
        assert_eq!(shape, [shape[0]; 3]);
        let data = &bytes[header_end..];
        let values: Vec<f64> = match descr.as_str() {
            "<i2" => data.chunks_exact(2).map(|b| f64::from(i16::from_le_bytes([b[0], b[1]]))).collect(),
            "<f4" => data
                .chunks_exact(4)
                .map(|b| f64::from(f32::from_le_bytes(b.try_into().expect("four bytes"))))
                .collect(),
            other => panic!("unexpected type {other}"),
        };
        assert_eq!(values.len(), shape[0].pow(3));
        Array { descr, axis: shape[0], values }
    }

    pub fn at(&self, [x, y, z]: [usize; 3]) -> f64 {
        self.values[(z * self.axis + y) * self.axis + x]
    }

    pub fn sum(&self) -> f64 {
        self.values.iter().sum()
    }
}
