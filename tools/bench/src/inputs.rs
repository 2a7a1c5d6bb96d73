//! Inputs in the cache folder: made when they are missing, and checked byte by byte before they are measured.

use crate::child;
use crate::result::InputFact;
use anyhow::{Context, anyhow};
use brickfield_bench_data::inputs::{Recipe, Spec};
use brickfield_bench_data::write::HashingWriter;
use brickfield_engine::Progress;
use brickfield_engine::part::{PartFile, free_bytes};
use brickfield_terminal::failure::Failure;
use brickfield_terminal::output::in_line;
use brickfield_terminal::units::Size;
use std::collections::BTreeSet;
use std::ffi::OsString;
use std::fs::{self, File};
use std::io::{self, BufWriter, Read};
use std::path::{Path, PathBuf};

/// The folder of the inputs.
pub struct Cache {
    folder: PathBuf,
}

impl Cache {
    /// `folder`, or the one where the user's programs keep what can be made again.
    ///
    /// # Errors
    /// If it cannot be made, or nobody knows where it should be.
    pub fn open(folder: Option<PathBuf>) -> Result<Cache, Failure> {
        let folder = folder.or_else(default_folder).ok_or_else(|| {
            Failure::Usage("there is no home folder to keep inputs in: give --cache".to_owned())
        })?;
        let told = || format!("{}: cannot make this folder; give another with --cache", in_line(&folder));
        fs::create_dir_all(&folder).with_context(told)?;
        // Programs are run in a folder of their own.
        let folder = fs::canonicalize(&folder).with_context(told)?;
        Ok(Cache { folder })
    }

    /// Where it is.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// The file of an input.
    pub fn path(&self, spec: &Spec) -> PathBuf {
        self.folder.join(spec.name)
    }

    /// Asks for room for those of `specs` that are missing, and for `scratch` bytes beside.
    ///
    /// # Errors
    /// If the disk has less.
    pub fn require_room(&self, specs: &[&'static Spec], scratch: u64) -> Result<(), Failure> {
        let folder = in_line(&self.folder);
        let mut counted = BTreeSet::new();
        let missing = specs.iter().filter(|spec| !self.path(spec).exists() && counted.insert(spec.name));
        let needed = scratch + missing.map(|spec| spec.bytes_max()).sum::<u64>();
        let free = free_bytes(&self.folder).with_context(|| format!("{folder}: cannot tell what is free"))?;
        if free < needed {
            let (needed, free) = (Size(needed), Size(free));
            let remedy = "free some, or give another folder with --cache";
            return Err(
                anyhow!("{folder}: {needed} of disk are needed, and {free} are free; {remedy}").into()
            );
        }
        Ok(())
    }

    /// Makes an input if it is missing or damaged. To hash it also brings it into the page cache.
    ///
    /// # Errors
    /// If it cannot be written or read, or the generator makes other bytes than it used to.
    pub fn ensure(&self, spec: &Spec, progress: &dyn Progress) -> Result<InputFact, Failure> {
        progress.phase(spec.name, None, "bytes");
        let path = self.path(spec);
        if let Ok((hash, bytes)) = hash_of(&path, progress)
            && hash == spec.hash
        {
            return fact(spec, &path, bytes);
        }
        progress.check()?;
        self.make(spec, &path, progress)?;
        let (hash, bytes) =
            hash_of(&path, progress).with_context(|| format!("{}: cannot be read", in_line(&path)))?;
        progress.check()?;
        if hash != spec.hash {
            let what = format!("has the hash {hash:016x}, and figures are told of {:016x}", spec.hash);
            let remedy = "what makes it has changed: correct the hash in bench-data/src/inputs.rs";
            return Err(anyhow!("{}: this input {what}; {remedy}", in_line(&path)).into());
        }
        fact(spec, &path, bytes)
    }

    fn make(&self, spec: &Spec, path: &Path, progress: &dyn Progress) -> Result<(), Failure> {
        if let Recipe::Swept(toolpath, sides, _) = &spec.recipe {
            let source = self.folder.join(toolpath.name);
            let mut file = PartFile::create(&source)?;
            file.append(toolpath.bytes)?;
            file.finish()?;
            let mut args: Vec<OsString> = ["beads", "--quiet", "--sides"].map(OsString::from).into();
            args.extend([sides.to_string().into(), source.into(), "-o".into(), path.into()]);
            return child::run_measured(&args, &self.folder).map(drop);
        }
        let base =
            spec.base().map(|base| self.ensure(base, progress).map(|_| self.path(base))).transpose()?;
        progress.phase(spec.name, None, "bytes");
        let file = PartFile::create(path)?;
        let mut out = BufWriter::with_capacity(1 << 20, ReportedWriter { file, progress });
        let written = spec.write(base.as_deref(), &mut out);
        progress.check()?;
        let told = || format!("{}: cannot be written", in_line(path));
        written.with_context(told)?;
        let Ok(ReportedWriter { mut file, .. }) = out.into_inner() else {
            return Err(anyhow!(told()).into());
        };
        Ok(file.finish()?)
    }
}

/// `brickfield` in the user's folder of caches.
fn default_folder() -> Option<PathBuf> {
    let set = |name| std::env::var_os(name).filter(|value| !value.is_empty()).map(PathBuf::from);
    let caches = set("XDG_CACHE_HOME").or_else(|| set("HOME").map(|home| home.join(".cache")));
    caches.map(|caches| caches.join("brickfield"))
}

/// A file that tells how much of it is written, and that ends when the user asks to stop.
struct ReportedWriter<'a> {
    file: PartFile,
    progress: &'a dyn Progress,
}

impl io::Write for ReportedWriter<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if self.progress.cancelled() {
            return Err(io::Error::other("stopped"));
        }
        self.progress.advance(bytes.len() as u64);
        self.file.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

/// FNV-1a of a file and its length.
fn hash_of(path: &Path, progress: &dyn Progress) -> io::Result<(u64, u64)> {
    let (mut file, mut buffer) = (File::open(path)?, vec![0; 1 << 20]);
    let mut hashed = HashingWriter::new(io::sink());
    loop {
        let bytes = file.read(&mut buffer)?;
        if bytes == 0 || progress.cancelled() {
            return Ok((hashed.hash(), hashed.bytes()));
        }
        progress.advance(bytes as u64);
        io::Write::write_all(&mut hashed, &buffer[..bytes])?;
    }
}

fn fact(spec: &Spec, path: &Path, bytes: u64) -> Result<InputFact, Failure> {
    let is_stl = spec.name.ends_with(".stl");
    let triangles = is_stl.then(|| stl_triangles(path)).transpose();
    let triangles = triangles.with_context(|| format!("{}: cannot be read", in_line(path)))?;
    Ok(InputFact { name: spec.name.to_owned(), bytes, triangles, fnv1a: format!("{:016x}", spec.hash) })
}

/// The number of facets that a binary STL tells.
fn stl_triangles(path: &Path) -> io::Result<u64> {
    let mut head = [0; 84];
    File::open(path)?.read_exact(&mut head)?;
    Ok(u64::from(u32::from_le_bytes([head[80], head[81], head[82], head[83]])))
}

#[cfg(test)]
mod tests {
    use super::*;
    use brickfield_bench_data::inputs::PILE_50K;

    #[test]
    fn room_is_asked_for() {
        let folder = tempfile::tempdir().unwrap();
        let cache = Cache::open(Some(folder.path().to_owned())).unwrap_or_else(|_| panic!("a folder"));
        assert!(cache.require_room(&[&PILE_50K, &PILE_50K], 0).is_ok());
        let Err(Failure::Run(error)) = cache.require_room(&[], u64::MAX) else { panic!("there is less") };
        assert!(error.to_string().contains("--cache"), "{error}");
    }
}
