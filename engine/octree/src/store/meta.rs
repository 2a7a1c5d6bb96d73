//! The metadata of a store, and the only place that uses bincode.
//!
//! bincode is no longer maintained; it stays pinned, behind a size limit, for this one small blob. Its bytes
//! (fixed-width little-endian integers, u64 lengths) are described in `FORMAT.md`, so that another encoder
//! can take over.

use super::identity::IdentityPlace;
use super::layout::{FILE_ID_BYTES, FileId, META_BYTES_MAX, Version};
use super::order::subtree_level;
use super::shard::{Shard, ShardNumbers};
use super::volumes::SourceVolumes;
use crate::brick::Count;
use crate::lattice::{MAX_LEVEL, RootCube};
use bincode::Options;
use serde::{Deserialize, Serialize};
use std::fmt;

/// Where a store came from and how it was made. No times and no machine: equal input and settings give equal
/// bytes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Meta {
    /// Name and version of the program that wrote the store.
    pub program: String,
    /// The input files, in the order given.
    pub sources: Vec<Source>,
    /// Length unit of all world positions, as in "mm"; empty if unknown.
    pub unit: String,
    /// Where the lattice lies in the world.
    pub root: RootCube,
    /// Lower corner of the input's bounding box, in `unit`.
    pub bounds_min: [f64; 3],
    /// Upper corner of the input's bounding box, in `unit`.
    pub bounds_max: [f64; 3],
    /// Depth limit: no node is deeper.
    pub depth: u8,
    /// When a node was divided.
    pub refine: Refine,
    /// Largest standard deviation of a leaf's samples above the depth limit.
    pub stddev: f64,
    /// How far, in `unit`, the boundary may be from the mesh of a leaf above the depth limit, if such leaves were asked
    /// for.
    pub tolerance: Option<f64>,
    /// Numbers that the build found.
    pub numbers: BuildCounts,
    /// What is to be known of beads, if the samples count those. Version 2 of the format has it after all else.
    #[serde(skip)]
    pub beads: Option<BeadsMeta>,
    /// Which shard of a store the file is, if it is not a whole one. Version 3 of the format has it at the very end.
    #[serde(skip)]
    pub shard: Option<Shard>,
    /// Volumes of the source, where it is closed; known at the end of a build only. An addition to the metadata.
    #[serde(skip)]
    pub volumes: Option<SourceVolumes>,
}

/// What version 2 adds: the samples count beads as solids.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BeadsMeta {
    /// Cross-section: "stadium" or "ellipse".
    pub section: String,
    /// Beads of all sources. Known at the end of a build only, like the rest.
    pub beads: u64,
    /// Segments of all beads.
    pub segments: u64,
    /// Where leaves say which beads they count; place and sizes are filled in by the writer. `None` if that
    /// was not asked for.
    pub identity: Option<IdentityPlace>,
    /// Passes of all beads, if the samples count those; `None` if they count beads. It stands behind all else in the file.
    #[serde(skip)]
    pub passes: Option<u64>,
}

impl BeadsMeta {
    /// What the samples count.
    pub fn count(&self) -> Count {
        if self.passes.is_some() { Count::Passes } else { Count::Beads }
    }
}

/// What some stores have behind all else, as a list; without any the list is left out, as in stores from before there
/// were additions.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
enum MetaExtension {
    /// The samples count passes, of which all beads have this many.
    Passes(u64),
    /// Volumes of the source.
    Volumes(SourceVolumes),
}

/// An input file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Source {
    /// The path as it was given.
    pub path: String,
    /// File size.
    pub bytes: u64,
    /// Facets read from it, or points of a point cloud.
    pub facets: u64,
    /// Kind of file, as in "STL binary"; of point clouds "PLY points" or "XYZ points".
    pub format: String,
    /// BLAKE3 of its content.
    pub blake3: [u8; 32],
}

impl Source {
    /// Whether it is a point cloud.
    pub fn is_cloud(&self) -> bool {
        self.format.contains(" points") || self.format.starts_with("points ")
    }
}

/// The criterion by which nodes above the depth limit are divided.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Refine {
    /// Where the standard deviation of the samples exceeds the threshold, and wherever facets hide between
    /// the samples: crossings that cancel on a lattice edge, or facets in a brick whose samples all agree.
    /// With a threshold of 0 no facet, however small, is missed above the depth limit.
    #[default]
    Hidden,
    /// On the standard deviation alone (Peelar et al. 2019).
    Stddev,
    /// Only where the boundary w = 0.5 passes, seen or hidden: the standard deviation is that of the inside
    /// indicator (0 or 1).
    Surface,
    /// Everywhere down to the level `base`, and from there to the depth limit only where a wall or a gap of the boundary
    /// w = 0.5 hides between two samples.
    Thin {
        /// The level to which all that a piece touches is divided.
        base: u8,
    },
}

impl fmt::Display for Refine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Refine::Hidden => f.write_str("hidden"),
            Refine::Stddev => f.write_str("stddev"),
            Refine::Surface => f.write_str("surface"),
            Refine::Thin { base } => write!(f, "hidden to level {base}, thin walls and gaps below"),
        }
    }
}

/// What a build counted. Known at its end only, so not part of the store's identity.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct BuildCounts {
    /// Facets of all sources, or points of point clouds.
    pub facets: u64,
    /// Those without area, which were left out.
    pub degenerate_facets: u64,
    /// Nodes on each level, the root first. The writer fills this in.
    pub nodes_per_level: Vec<u64>,
}

impl Meta {
    /// Whether there was a point cloud among the inputs: then points are among what counts as facets.
    pub fn holds_points(&self) -> bool {
        self.sources.iter().any(Source::is_cloud)
    }

    /// What the numbers of facets count.
    pub fn counted(&self) -> &'static str {
        match (self.holds_points(), self.sources.iter().all(Source::is_cloud)) {
            (false, _) => "facets",
            (true, true) => "points",
            (true, false) => "pieces",
        }
    }

    /// Of a store whose surface was made anew from this one's, as in `offset by` a length: it is divided at its surface alone,
    /// and knows neither beads nor volumes of a source.
    pub fn remade(&self, how: &str, length: f64) -> Meta {
        Meta {
            program: format!("{}, {how} {length} {}", self.program, self.unit).trim_end().to_owned(),
            refine: Refine::Surface,
            stddev: 0.0,
            tolerance: None,
            beads: None,
            shard: None,
            volumes: None,
            ..self.clone()
        }
    }

    /// The level whose subtrees a build appends one after the other: see [`super::build_order`].
    pub fn subtree_level(&self) -> u8 {
        match self.refine {
            Refine::Thin { base } => subtree_level(base),
            _ => subtree_level(self.depth),
        }
    }

    /// What ties the parts of a file together: a hash of everything but [`Meta::numbers`].
    pub fn file_id(&self) -> FileId {
        let beads = self.beads.clone().map(|beads| BeadsMeta {
            beads: 0,
            segments: 0,
            identity: beads.identity.map(|_| IdentityPlace::default()),
            passes: beads.passes.map(|_| 0),
            ..beads
        });
        let shard = self.shard.clone().map(|shard| Shard { found: ShardNumbers::default(), ..shard });
        let meta = Meta { numbers: BuildCounts::default(), beads, shard, volumes: None, ..self.clone() };
        // Serializing plain data into memory fails only at a limit, and none is set here.
        let bytes = meta.serialize(options()).unwrap_or_default();
        let mut id = [0; FILE_ID_BYTES];
        id.copy_from_slice(&blake3::hash(&bytes).as_bytes()[..FILE_ID_BYTES]);
        id
    }

    /// What two builds of the same store, or of shards of it, have in common, by name: all that is known when a build
    /// begins, but for which shard it is. Lists of the same names come first, so that the first difference of two
    /// lists is one of values.
    pub fn facts(&self) -> Vec<(String, String)> {
        let mut facts = vec![("number of inputs".to_owned(), self.sources.len().to_string())];
        let mut fact = |name: &str, value: String| facts.push((name.to_owned(), value));
        for (number, source) in self.sources.iter().enumerate() {
            let hash: String = source.blake3.iter().map(|byte| format!("{byte:02x}")).collect();
            fact(&format!("BLAKE3 hash of input {}", number + 1), hash);
            fact(&format!("path of input {}", number + 1), format!("{:?}", source.path));
            fact(
                &format!("kind of input {}", number + 1),
                format!("{}, {} facets", source.format, source.facets),
            );
        }
        fact("program", self.program.clone());
        let shard = self.shard.as_ref();
        fact("number of shards", shard.map_or(1, |shard| shard.id.of).to_string());
        fact("depth", self.depth.to_string());
        fact("criterion", self.refine.to_string());
        fact("standard deviation", self.stddev.to_string());
        fact("tolerance", self.tolerance.map_or("none".to_owned(), |tolerance| tolerance.to_string()));
        fact("error of samples", shard.map_or("none".to_owned(), |shard| shard.gwn_error.to_string()));
        fact("unit", self.unit.clone());
        let beads = self.beads.as_ref();
        let count = beads.map_or("none".to_owned(), |beads| beads.count().to_string());
        fact("unit of count", count);
        fact("section of beads", beads.map_or("none".to_owned(), |beads| beads.section.clone()));
        let identity = beads.is_some_and(|beads| beads.identity.is_some());
        fact("identity of beads", if identity { "recorded" } else { "not recorded" }.to_owned());
        fact("box", format!("{:?} to {:?}", self.bounds_min, self.bounds_max));
        fact("root cube", format!("{:?} with an edge of {}", self.root.origin, self.root.edge));
        facts
    }

    /// The lowest version of the format that holds this.
    pub(super) fn version(&self) -> Version {
        match (&self.beads, &self.shard) {
            (_, Some(_)) => Version::Three,
            (Some(_), None) => Version::Two,
            (None, None) => Version::One,
        }
    }

    /// The stored form, that of [`Meta::version`]; the error is one phrase.
    pub(super) fn encode(&self) -> Result<Vec<u8>, String> {
        self.check()?;
        let bytes = self.serialize(options().with_limit(META_BYTES_MAX as u64));
        let bytes = bytes.ok().filter(|bytes| bytes.len() <= META_BYTES_MAX);
        bytes.ok_or_else(|| format!("the metadata takes more than {META_BYTES_MAX} bytes"))
    }

    /// The stored form of a shard's metadata, for other files than shards.
    ///
    /// # Errors
    /// One phrase, if it is not a shard's, or too large.
    pub fn to_shard_bytes(&self) -> Result<Vec<u8>, String> {
        if self.shard.is_none() { Err("it is not a shard's".into()) } else { self.encode() }
    }

    /// What [`Self::to_shard_bytes`] has made. Takes memory in proportion to `bytes`.
    ///
    /// # Errors
    /// One phrase, if it is something else.
    pub fn from_shard_bytes(bytes: &[u8]) -> Result<Meta, String> {
        Meta::decode(bytes, Version::Three)
    }

    fn serialize(&self, options: impl Options + Copy) -> bincode::Result<Vec<u8>> {
        let mut bytes = match (&self.beads, &self.shard) {
            (None, None) => options.serialize(self),
            (Some(beads), None) => options.serialize(&(self, beads)),
            (beads, Some(shard)) => options.serialize(&(self, beads, shard)),
        }?;
        let passes = self.beads.as_ref().and_then(|beads| beads.passes);
        let volumes = self.volumes.clone().map(MetaExtension::Volumes);
        let additions: Vec<MetaExtension> =
            passes.map(MetaExtension::Passes).into_iter().chain(volumes).collect();
        if !additions.is_empty() {
            bytes.extend(options.serialize(&additions)?);
        }
        Ok(bytes)
    }

    /// Takes over what is behind all else.
    fn add(mut self, bytes: &[u8]) -> Result<Meta, String> {
        if bytes.is_empty() {
            return Ok(self);
        }
        let options = options().with_limit(META_BYTES_MAX as u64);
        let additions: Vec<MetaExtension> =
            options.deserialize(bytes).map_err(|_| "the metadata's additions cannot be read".to_owned())?;
        for addition in additions {
            match (addition, &mut self.beads) {
                (MetaExtension::Passes(passes), Some(beads)) => beads.passes = Some(passes),
                (MetaExtension::Passes(_), None) => {
                    return Err("passes of beads where there are no beads".into());
                }
                (MetaExtension::Volumes(volumes), _) => self.volumes = Some(volumes),
            }
        }
        Ok(self)
    }

    /// Reads the stored form; the error is one phrase. Takes memory in proportion to `bytes`.
    pub(super) fn decode(bytes: &[u8], version: Version) -> Result<Meta, String> {
        let options = options().with_limit(META_BYTES_MAX as u64).allow_trailing_bytes();
        let meta: bincode::Result<Meta> = match version {
            Version::One => options.deserialize(bytes),
            Version::Two => options
                .deserialize(bytes)
                .map(|(meta, beads): (Meta, BeadsMeta)| Meta { beads: Some(beads), ..meta }),
            Version::Three => {
                options.deserialize(bytes).map(|(meta, beads, shard): (Meta, Option<BeadsMeta>, Shard)| {
                    Meta { beads, shard: Some(shard), ..meta }
                })
            }
        };
        let meta = meta.map_err(|_| "the metadata cannot be read".to_owned())?;
        // Every value has one form, so what was read has the length of what would be written.
        let known = meta.serialize(options).map_or(bytes.len(), |known| known.len());
        let meta = meta.add(bytes.get(known..).unwrap_or_default())?;
        meta.check()?;
        Ok(meta)
    }

    /// Values that the rest of the program may rely on.
    fn check(&self) -> Result<(), String> {
        let finite = |values: &[f64]| values.iter().all(|v| v.is_finite());
        if !finite(&self.root.origin) || !self.root.edge.is_finite() || self.root.edge <= 0.0 {
            return Err("the root cube is not a cube".into());
        }
        if !finite(&self.bounds_min) || !finite(&self.bounds_max) {
            return Err("the bounds are not finite".into());
        }
        if self.depth > MAX_LEVEL {
            return Err(format!("a depth of {} levels, beyond {MAX_LEVEL}", self.depth));
        }
        if let Refine::Thin { base } = self.refine
            && base > self.depth
        {
            return Err(format!("a base level of {base}, beyond the depth of {}", self.depth));
        }
        if self.stddev.is_nan() || self.tolerance.is_some_and(f64::is_nan) {
            return Err("a threshold is not a number".into());
        }
        if self.volumes.as_ref().is_some_and(|volumes| !volumes.is_sound()) {
            return Err("a volume is not a number".into());
        }
        self.shard.as_ref().map_or(Ok(()), |shard| shard.check(self.depth))
    }
}

fn options() -> impl Options + Copy {
    bincode::DefaultOptions::new().with_fixint_encoding().with_little_endian().reject_trailing_bytes()
}

#[cfg(test)]
mod tests {
    use super::super::testing::meta;
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn identity_leaves_the_numbers_out() {
        let mut other = meta(3);
        other.numbers.facets += 1;
        assert_eq!(other.file_id(), meta(3).file_id());
        other.depth += 1;
        assert_ne!(other.file_id(), meta(3).file_id());
        assert_eq!(Meta::decode(&other.encode().unwrap(), Version::One), Ok(other));
    }

    #[test]
    fn passes_stand_behind_all_else() {
        let beads =
            BeadsMeta { section: "stadium".into(), beads: 2, segments: 3, identity: None, passes: None };
        let of_beads = Meta { beads: Some(beads.clone()), ..meta(3) };
        let of_passes = Meta { beads: Some(BeadsMeta { passes: Some(5), ..beads }), ..meta(3) };
        assert_ne!(of_beads.file_id(), of_passes.file_id());
        let (short, long) = (of_beads.encode().unwrap(), of_passes.encode().unwrap());
        assert_eq!(long[..short.len()], short);
        assert_eq!(long.len(), short.len() + 8 + 4 + 8);
        assert_eq!(Meta::decode(&long, Version::Two), Ok(of_passes));
        assert_eq!(Meta::decode(&short, Version::Two), Ok(of_beads));
        for cut in short.len() + 1..long.len() {
            assert!(Meta::decode(&long[..cut], Version::Two).is_err());
        }
        let without_beads = [meta(3).encode().unwrap(), long[short.len()..].to_vec()].concat();
        assert!(Meta::decode(&without_beads, Version::One).is_err());
    }

    #[test]
    fn unreasonable_values_are_refused() {
        let mut other = meta(3);
        other.root.edge = f64::NAN;
        assert!(other.encode().is_err());
        other = meta(MAX_LEVEL + 1);
        assert!(other.encode().is_err());
        other = meta(3);
        other.unit = "m".repeat(META_BYTES_MAX);
        assert!(other.encode().is_err());
    }

    proptest! {
        #[test]
        fn any_bytes_are_read_or_refused(at in any::<prop::sample::Index>(), value in any::<u64>(),
                                         cut in any::<prop::sample::Index>()) {
            let mut bytes = meta(3).encode().unwrap();
            prop_assert!(Meta::decode(&bytes[..cut.index(bytes.len())], Version::One).is_err());
            let at = at.index(bytes.len() - 8);
            bytes[at..at + 8].copy_from_slice(&value.to_le_bytes());
            for version in [Version::One, Version::Two, Version::Three] {
                let _ = Meta::decode(&bytes, version);
            }
        }
    }
}
