//! Meshes as builds read them: measured, their pieces turned outward where that is asked for, snapped to the lattice.

use super::bins::Binner;
use super::options::BuildOptions;
use super::resources::{Resources, SpillResources};
use super::snap::{SnappedSoup, snap};
use super::summary::FacetsSummary;
use crate::error::{Error, Result};
use crate::ingest::{Facets, Input, Survey};
use crate::lattice::RootCube;
use crate::pieces::{FlippedFacets, FlippedSource, InsideOut, PiecesReport, study};
use crate::progress::Progress;
use crate::store::Source;
use crate::winding::{FAR_FIELD_BYTES, OpenSummary};

/// Meshes that are built together, in the order in which they were given.
pub(super) struct MeshInputs<'a> {
    pub opened: &'a [Input],
    /// What was found of their pieces, and the facets to be turned over.
    turned: Option<(PiecesReport, FlippedFacets)>,
}

impl<'a> MeshInputs<'a> {
    /// As they were read.
    pub fn given(opened: &'a [Input]) -> MeshInputs<'a> {
        MeshInputs { opened, turned: None }
    }

    /// Finds the pieces that the options say are to be turned over.
    pub fn turn(&mut self, root: RootCube, options: &BuildOptions, progress: &dyn Progress) -> Result<()> {
        let memory = options.resources.memory;
        let study = |way| study(&self.sources(), root, way, memory, progress);
        self.turned = options.orient.map(study).transpose()?;
        Ok(())
    }

    /// Whether pieces were looked at.
    pub fn are_turned(&self) -> bool {
        self.turned.is_some()
    }

    fn sources(&self) -> Vec<&'a dyn Facets> {
        self.opened.iter().map(|input| input as &dyn Facets).collect()
    }

    /// What `then` makes of their facets, which are those that passes read.
    pub fn with_soups<T>(&self, then: impl FnOnce(&[&dyn Facets]) -> T) -> T {
        let given = self.sources();
        match &self.turned {
            None => then(&given),
            Some((_, turned)) => then(&FlippedSource::sources(&turned.apply(&given))),
        }
    }

    /// Facets of all.
    pub fn facets(&self) -> u64 {
        self.opened.iter().map(Input::facets).sum()
    }

    /// The snapped triangles. See [`snap`].
    ///
    /// # Errors
    /// Files that have changed meanwhile or are damaged; if no facet has an area.
    pub fn snapped(
        &self,
        root: RootCube,
        cubes: (Binner, Option<u8>),
        room: &SpillResources,
        progress: &dyn Progress,
    ) -> Result<SnappedSoup> {
        progress.phase("snapping", Some(self.facets()), "facets");
        let soup = self.with_soups(|soups| snap(soups, root, cubes, room, progress))?;
        self.check()?;
        self.require_area(&soup)?;
        Ok(soup)
    }

    /// Fails if a file has changed or was found to be damaged since it was opened.
    pub fn check(&self) -> Result<()> {
        self.opened.iter().try_for_each(Input::check)
    }

    /// Fails if no facet has an area.
    fn require_area(&self, soup: &SnappedSoup) -> Result<()> {
        match self.opened.first() {
            Some(first) if soup.degenerate == self.facets() => Err(Error::input(
                first.path(),
                "facets",
                format!("none of the {} facets has an area", soup.degenerate),
                "export the mesh again, in a unit in which its details are not lost",
            )),
            _ => Ok(()),
        }
    }

    /// What was read, of which `degenerate_facets` have no area on the lattice.
    pub fn summary(
        self,
        degenerate_facets: u64,
        open: OpenSummary,
        inside_out: Option<InsideOut>,
    ) -> FacetsSummary {
        FacetsSummary {
            facets: self.facets(),
            degenerate_facets,
            skipped_faces: self.opened.iter().map(Input::skipped_faces).sum(),
            open_edges: open.open_edges,
            loops: open.loops,
            flipped_patches: open.flipped_patches,
            pieces: self.turned.map(|(report, _)| report),
            inside_out,
            turned_sweeps: self.opened.iter().map(Input::turned_sweeps).sum(),
        }
    }
}

/// Where meshes lie, each for itself.
pub(super) fn survey_all(opened: &[Input], progress: &dyn Progress) -> Result<Vec<Survey>> {
    opened.iter().map(|input| input.survey(progress)).collect()
}

/// What a store records of a mesh, given the hash of its bytes.
pub(super) fn describe(input: &Input, identity: [u8; 32]) -> Source {
    Source {
        path: input.path().display().to_string(),
        bytes: input.bytes(),
        facets: input.facets(),
        format: input.describe().to_owned(),
        blake3: identity,
    }
}

/// The pieces of an open soup whose nodes decide for themselves stay in memory, those of two levels of nodes at a time. Measured beside the far field: 93
/// bytes a facet of 5 million.
const OPEN_BYTES_A_FACET: u64 = 100;

/// Fails if facets that have to be in memory, and why, need more than there is; `remedy` is what helps beside more memory.
pub(super) fn require_room_for_facets(
    facets: u64,
    resources: &Resources,
    (why, remedy): (&str, &str),
) -> Result<()> {
    let need = facets.saturating_mul(OPEN_BYTES_A_FACET).saturating_add(FAR_FIELD_BYTES);
    if need <= resources.memory {
        return Ok(());
    }
    let mib = |bytes: u64| bytes.div_ceil(1 << 20);
    Err(Error::setting(
        format!(
            "{why}, and its {facets} facets need {} MiB of the {} MiB that there are",
            mib(need),
            mib(resources.memory)
        ),
        format!("allow more with `memory`, or {remedy}"),
    ))
}
