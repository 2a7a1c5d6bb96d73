//! What the elements of a scene mean to a reader of sweeps.

/// The part that an element plays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum NodeRole {
    /// Holds nodes and changes nothing: Scene, Group, Shape and the like.
    Group,
    /// Moves its children.
    Transform,
    /// Shows the one child that `whichChoice` names.
    Switch,
    /// Shows its first child, the finest.
    Lod,
    /// A sweep.
    Extrusion,
    /// Holds shapes that are not read; reported by name.
    Skipped(&'static str),
    /// Says about other nodes, and is no child of a Switch or LOD: metadata, routes.
    Remark,
    /// Anything else: what stands in it is not looked at.
    Other,
}

/// Elements whose loss a user must learn of: other geometry, and what brings geometry from elsewhere or moves
/// it in ways that are not followed.
const SKIPPED: [&str; 51] = [
    "Arc2D",
    "ArcClose2D",
    "Box",
    "Circle2D",
    "Cone",
    "Cylinder",
    "Disk2D",
    "ElevationGrid",
    "ExternProtoDeclare",
    "GeoElevationGrid",
    "GeoLOD",
    "GeoLocation",
    "GeoTransform",
    "HAnimDisplacer",
    "HAnimHumanoid",
    "HAnimJoint",
    "HAnimMotion",
    "HAnimSegment",
    "HAnimSite",
    "IndexedFaceSet",
    "IndexedLineSet",
    "IndexedQuadSet",
    "IndexedTriangleFanSet",
    "IndexedTriangleSet",
    "IndexedTriangleStripSet",
    "Inline",
    "IsoSurfaceVolumeData",
    "LineSet",
    "NurbsCurve",
    "NurbsPatchSurface",
    "NurbsSweptSurface",
    "NurbsSwungSurface",
    "NurbsTrimmedSurface",
    "ParticleSystem",
    "PointSet",
    "Polyline2D",
    "Polypoint2D",
    "ProtoDeclare",
    "ProtoInstance",
    "QuadSet",
    "Rectangle2D",
    "RigidBodyCollection",
    "SegmentedVolumeData",
    "Sphere",
    "Text",
    "TriangleFanSet",
    "TriangleSet",
    "TriangleSet2D",
    "TriangleStripSet",
    "VolumeData",
    "EspduTransform",
];

/// What the element `name` (without a prefix) is.
pub(super) fn kind(name: &str) -> NodeRole {
    match name {
        "Scene" | "Group" | "StaticGroup" | "Shape" | "Anchor" | "Billboard" | "Collision"
        | "CADAssembly" | "CADFace" | "CADLayer" | "Layer" | "LayerSet" | "LayoutGroup" | "LayoutLayer"
        | "PickableGroup" | "ScreenGroup" | "Viewport" => NodeRole::Group,
        "Transform" | "CADPart" => NodeRole::Transform,
        "Switch" => NodeRole::Switch,
        "LOD" => NodeRole::Lod,
        "Extrusion" => NodeRole::Extrusion,
        "ROUTE" | "IS" | "IMPORT" | "EXPORT" => NodeRole::Remark,
        _ if name.starts_with("Metadata") => NodeRole::Remark,
        _ => {
            SKIPPED.iter().find(|skipped| **skipped == name).map_or(NodeRole::Other, |s| NodeRole::Skipped(s))
        }
    }
}
