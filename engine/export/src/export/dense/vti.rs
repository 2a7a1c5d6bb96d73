//! VTK image data: XML with zlib blocks behind it.

use super::layers::compressed;
use crate::analysis::Element;
use crate::error::Result;
use crate::export::{Format, Volume};
use crate::lattice::BRICK_CELLS;
use crate::part::PartFile;
use crate::progress::Progress;
use std::path::Path;

/// The format.
pub(in crate::export) struct Vti;

impl Format for Vti {
    fn ending(&self) -> &'static str {
        "vti"
    }

    fn name(&self) -> &'static str {
        "VTK image data"
    }

    fn bytes_about(&self, volume: &Volume<'_>) -> u128 {
        volume.dense_bytes() + volume.dense_bytes() / 500 + 8 * blocks(volume) as u128 + 4096
    }

    fn write(&self, volume: &Volume<'_>, path: &Path, progress: &dyn Progress) -> Result<()> {
        let mut file = PartFile::create(path)?;
        file.append(header(volume).as_bytes())?;
        let sizes_at = file.appended();
        let block = (volume.axis() * BRICK_CELLS * volume.element.bytes()) as u64;
        let mut sizes = [blocks(volume) as u64, block, 0].map(u64::to_le_bytes).concat();
        // The sizes of the blocks are written when they are known.
        file.append(&vec![0; sizes.len() + 8 * blocks(volume)])?;
        compressed(volume, progress, &mut |block| {
            sizes.extend((block.len() as u64).to_le_bytes());
            file.append(block)
        })?;
        file.append(b"\n</AppendedData>\n</VTKFile>\n")?;
        file.overwrite(sizes_at, &sizes)?;
        file.finish()
    }
}

/// Blocks of the file, each 32 rows of a layer.
fn blocks(volume: &Volume<'_>) -> usize {
    volume.axis() * (volume.axis() / BRICK_CELLS)
}

fn header(volume: &Volume<'_>) -> String {
    let ([x, y, z], step, last) = (volume.origin(), volume.spacing(volume.finest()), volume.axis() - 1);
    let kind = match volume.element {
        Element::I16 => "Int16",
        Element::F32 => "Float32",
    };
    let (name, extent) = (volume.name, format!("0 {last} 0 {last} 0 {last}"));
    format!(
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"ImageData\" version=\"1.0\" byte_order=\"LittleEndian\" \
         header_type=\"UInt64\" compressor=\"vtkZLibDataCompressor\">\n<ImageData WholeExtent=\"{extent}\" \
         Origin=\"{x} {y} {z}\" Spacing=\"{step} {step} {step}\">\n<Piece Extent=\"{extent}\">\n<PointData \
         Scalars=\"{name}\">\n<DataArray type=\"{kind}\" Name=\"{name}\" format=\"appended\" offset=\"0\"/>\n\
         </PointData>\n</Piece>\n</ImageData>\n<AppendedData encoding=\"raw\">\n_"
    )
}
