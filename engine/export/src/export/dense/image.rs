//! Raw samples, alone or behind a text: MetaImage (`.mhd` with `.raw`, or `.mha`), and arrays with a description.

use super::npy_header;
use crate::analysis::Element;
use crate::error::{Error, Result};
use crate::export::{Format, Volume};
use crate::part::{PartFile, PartPair};
use crate::progress::Progress;
use std::path::Path;

/// MetaImage with the samples in a file beside it.
pub(in crate::export) struct Mhd;
/// MetaImage in one file.
pub(in crate::export) struct Mha;
/// NumPy's array, with a description as JSON beside it.
pub(in crate::export) struct Npy;
/// Samples alone, with a description as JSON beside them.
pub(in crate::export) struct Raw;

/// The header of a MetaImage whose samples lie in `data`.
fn header(volume: &Volume<'_>, data: &str) -> String {
    let [x, y, z] = volume.origin();
    let (step, axis) = (volume.spacing(volume.finest()), volume.axis());
    let element = match volume.element {
        Element::I16 => "MET_SHORT",
        Element::F32 => "MET_FLOAT",
    };
    format!(
        "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\nCompressedData = False\n\
         TransformMatrix = 1 0 0 0 1 0 0 0 1\nOffset = {x} {y} {z}\nElementSpacing = {step} {step} {step}\n\
         DimSize = {axis} {axis} {axis}\nElementType = {element}\nElementDataFile = {data}\n"
    )
}

/// Writes all samples behind what was appended.
fn samples(volume: &Volume<'_>, file: &PartFile, progress: &dyn Progress) -> Result<()> {
    let first = file.appended();
    volume.dense()?.write(progress, &|offset, bytes| file.write_at(bytes, first + offset))
}

/// Writes samples and a text that describes them as a pair.
fn pair(
    volume: &Volume<'_>,
    [data, text]: [&Path; 2],
    [head, told]: [&[u8]; 2],
    progress: &dyn Progress,
) -> Result<()> {
    let mut pair = PartPair::create(data, text)?;
    pair.file.append(head)?;
    samples(volume, &pair.file, progress)?;
    pair.description.append(told)?;
    pair.finish()
}

/// The name of the file of samples beside a MetaImage, if a line of text can tell it.
fn data_name(path: &Path) -> Result<String> {
    let data = path.with_extension("raw");
    let name = data.file_name().unwrap_or_default();
    let told = name.to_str().filter(|name| name.trim() == *name && !name.contains(char::is_control));
    told.map(str::to_owned).ok_or_else(|| {
        let what = "a MetaImage cannot tell the name of its samples, which is no plain line of text";
        Error::store(path, "output", what, "choose another name, or .mha")
    })
}

impl Format for Mhd {
    fn ending(&self) -> &'static str {
        "mhd"
    }

    fn name(&self) -> &'static str {
        "MetaImage, its samples in a .raw beside it"
    }

    fn beside(&self) -> Option<&'static str> {
        Some("raw")
    }

    fn require_writable(&self, path: &Path) -> Result<()> {
        data_name(path)?;
        PartFile::create(path).map(drop)
    }

    fn write(&self, volume: &Volume<'_>, path: &Path, progress: &dyn Progress) -> Result<()> {
        let data = path.with_extension("raw");
        let name = data_name(path)?;
        pair(volume, [&data, path], [&[], header(volume, &name).as_bytes()], progress)
    }
}

impl Format for Mha {
    fn ending(&self) -> &'static str {
        "mha"
    }

    fn name(&self) -> &'static str {
        "MetaImage in one file"
    }

    fn write(&self, volume: &Volume<'_>, path: &Path, progress: &dyn Progress) -> Result<()> {
        let mut file = PartFile::create(path)?;
        file.append(header(volume, "LOCAL").as_bytes())?;
        samples(volume, &file, progress)?;
        file.finish()
    }
}

impl Format for Npy {
    fn ending(&self) -> &'static str {
        "npy"
    }

    fn name(&self) -> &'static str {
        "a NumPy array, described by a .json beside it"
    }

    fn beside(&self) -> Option<&'static str> {
        Some("json")
    }

    fn write(&self, volume: &Volume<'_>, path: &Path, progress: &dyn Progress) -> Result<()> {
        let head = npy_header(volume.element.numpy(), volume.axis());
        let texts = [&head[..], volume.description.as_bytes()];
        pair(volume, [path, &path.with_extension("json")], texts, progress)
    }
}

impl Format for Raw {
    fn ending(&self) -> &'static str {
        "raw"
    }

    fn name(&self) -> &'static str {
        "samples alone, described by a .json beside them"
    }

    fn beside(&self) -> Option<&'static str> {
        Some("json")
    }

    fn write(&self, volume: &Volume<'_>, path: &Path, progress: &dyn Progress) -> Result<()> {
        pair(volume, [path, &path.with_extension("json")], [&[], volume.description.as_bytes()], progress)
    }
}
