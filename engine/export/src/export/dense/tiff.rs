//! TIFF: a page a layer of samples, BigTIFF beyond 4 GB.
//!
//! Pages are one strip each, not compressed, as tools for computed tomography read them. The description of the first is
//! that of ImageJ, which then takes the pages as one volume.

use crate::analysis::Element;
use crate::error::Result;
use crate::export::{Format, Volume};
use crate::part::PartFile;
use crate::progress::Progress;
use std::path::Path;

/// The format.
pub(in crate::export) struct Tiff;

/// Bytes of a directory at most, with what it points to.
const PAGE_BYTES: u128 = 512;
/// Entries of a directory.
const ENTRIES: usize = 14;
const SHORT: u16 = 3;
const LONG: u16 = 4;
const LONG8: u16 = 16;
const RATIONAL: u16 = 5;
const ASCII: u16 = 2;

impl Format for Tiff {
    fn ending(&self) -> &'static str {
        "tif"
    }

    fn name(&self) -> &'static str {
        "TIFF, a page a layer of samples"
    }

    fn bytes_about(&self, volume: &Volume<'_>) -> u128 {
        volume.dense_bytes() + volume.axis() as u128 * PAGE_BYTES
    }

    fn write(&self, volume: &Volume<'_>, path: &Path, progress: &dyn Progress) -> Result<()> {
        let mut file = PartFile::create(path)?;
        let layout = Layout::new(volume, self.bytes_about(volume) > u128::from(u32::MAX));
        file.append(&layout.head())?;
        let dense = volume.dense()?;
        dense.write(progress, &|offset, bytes| file.write_at(bytes, layout.first() + offset))?;
        file.write_at(&layout.pages(), layout.pages_at())?;
        file.finish()
    }
}

/// Where everything lies: the head with the description, the samples, the directories.
struct Layout {
    big: bool,
    axis: u64,
    element: Element,
    description: Vec<u8>,
    /// Samples a unit, as a fraction.
    resolution: [u32; 2],
}

impl Layout {
    fn new(volume: &Volume<'_>, big: bool) -> Layout {
        let (axis, step) = (volume.axis() as u64, volume.spacing(volume.finest()));
        let unit = volume.unit.unwrap_or("pixel");
        let mut description =
            format!("ImageJ=1.53t\nimages={axis}\nslices={axis}\nunit={unit}\nspacing={step}\nloop=false\n")
                .into_bytes();
        description.push(0);
        while !description.len().is_multiple_of(8) {
            description.push(0);
        }
        // A fraction that tells the step to six digits.
        let per_unit = step.recip();
        let below = if per_unit < 4000.0 { 1_000_000 } else { 1 };
        let resolution = [(per_unit * f64::from(below)).round().min(f64::from(u32::MAX)) as u32, below];
        Layout { big, axis, element: volume.element, description, resolution }
    }

    /// Bytes of the header, without the description.
    fn start(&self) -> u64 {
        if self.big { 16 } else { 8 }
    }

    /// Where the samples begin, behind the resolution.
    fn first(&self) -> u64 {
        self.start() + self.description.len() as u64 + 8
    }

    fn page_bytes(&self) -> u64 {
        self.axis * self.axis * self.element.bytes() as u64
    }

    fn pages_at(&self) -> u64 {
        self.first() + self.page_bytes() * self.axis
    }

    fn head(&self) -> Vec<u8> {
        let mut head = b"II".to_vec();
        if self.big {
            head.extend([43u16, 8, 0].map(u16::to_le_bytes).as_flattened());
            head.extend(self.pages_at().to_le_bytes());
        } else {
            head.extend(42u16.to_le_bytes());
            head.extend((self.pages_at() as u32).to_le_bytes());
        }
        head.extend(&self.description);
        head.extend(self.resolution.map(u32::to_le_bytes).as_flattened());
        head
    }

    /// All directories.
    fn pages(&self) -> Vec<u8> {
        let mut out = Vec::new();
        for page in 0..self.axis {
            self.page(page, &mut out);
        }
        out
    }

    fn directory_bytes(&self) -> u64 {
        if self.big { 8 + 20 * ENTRIES as u64 + 8 } else { 2 + 12 * ENTRIES as u64 + 4 }
    }

    fn page(&self, page: u64, out: &mut Vec<u8>) {
        let at = |offset: u64| (if self.big { LONG8 } else { LONG }, offset);
        let format = if self.element == Element::F32 { 3 } else { 2 };
        let resolution_at = self.start() + self.description.len() as u64;
        let entries: [(u16, (u16, u64), u64); ENTRIES] = [
            (256, (LONG, self.axis), 1),
            (257, (LONG, self.axis), 1),
            (258, (SHORT, 8 * self.element.bytes() as u64), 1),
            (259, (SHORT, 1), 1),
            // Black is 0.
            (262, (SHORT, 1), 1),
            (270, (ASCII, self.start()), self.description.len() as u64),
            (273, at(self.first() + page * self.page_bytes()), 1),
            (277, (SHORT, 1), 1),
            (278, (LONG, self.axis), 1),
            (279, at(self.page_bytes()), 1),
            (282, (RATIONAL, resolution_at), 1),
            (283, (RATIONAL, resolution_at), 1),
            // A unit that is not the inch nor the centimetre: the description says which.
            (296, (SHORT, 1), 1),
            (339, (SHORT, format), 1),
        ];
        self.count(ENTRIES as u64, out);
        for (tag, (kind, value), count) in entries {
            out.extend(tag.to_le_bytes());
            out.extend(kind.to_le_bytes());
            self.number(count, out);
            // Eight bytes of a BigTIFF hold a fraction itself.
            if kind == RATIONAL && self.big {
                out.extend(self.resolution.map(u32::to_le_bytes).as_flattened());
            } else {
                self.number(value, out);
            }
        }
        let next = self.pages_at() + (page + 1) * self.directory_bytes();
        self.number(if page + 1 < self.axis { next } else { 0 }, out);
    }

    fn count(&self, number: u64, out: &mut Vec<u8>) {
        if self.big {
            out.extend(number.to_le_bytes());
        } else {
            out.extend((number as u16).to_le_bytes());
        }
    }

    fn number(&self, number: u64, out: &mut Vec<u8>) {
        if self.big {
            out.extend(number.to_le_bytes());
        } else {
            out.extend((number as u32).to_le_bytes());
        }
    }
}
