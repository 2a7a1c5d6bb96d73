//! Moves of tools as convex solids.
//!
//! A tool is a stack of balls and frustums about its axis. Each sweeps a convex solid on a straight move; the tool sweeps
//! their union.

use crate::error::{Error, Result};
use crate::lattice::{RootCube, cross, dot};
use crate::milling::{Move, Program, Tool, ToolKind};
use crate::swept::{ConvexSolid, SweptSolid};

/// Frustums of the rounded corner of a bull-nose mill: chords of the quarter circle of at most this share of its radius.
const CORNER_STEPS: usize = 16;

/// A part of a tool; lengths in mm from the tip upward.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Part {
    Ball { height: f64, radius: f64 },
    Frustum { height: [f64; 2], radius: [f64; 2] },
}

/// What a program sweeps.
#[derive(Clone, Debug, Default)]
pub struct Cut {
    /// In the order of the program.
    pub solids: Vec<SweptSolid>,
    /// Of each solid, its move.
    pub moves: Vec<u32>,
    /// Largest deviation of frustums from rounded corners, in the store's unit.
    pub corner_error: f64,
    /// Largest deviation within the part of steps that keep the tool's direction from a tool that turns, in the store's unit.
    pub turn_error: f64,
}

impl Cut {
    /// The solids of a program on the lattice of a root cube whose unit is `unit` mm.
    ///
    /// # Errors
    /// [`Error::Setting`] if they and the moves take more than `memory` bytes.
    pub fn new(program: &Program, root: RootCube, unit: f64, memory: u64) -> Result<Cut> {
        let ball = (root.origin.map(|c| (c + 0.5 * root.edge) * unit), 0.5 * root.edge * unit * 3f64.sqrt());
        let scale = 1.0 / (root.unit() * unit);
        let origin = root.origin.map(|c| c * unit);
        // Beyond the root from anywhere within it.
        let reach = root.edge * unit * 4.0;
        let mut cut = Cut::default();
        let stacks: Vec<Vec<Part>> = program.tools.iter().map(|(_, tool)| stack(tool, reach)).collect();
        let count = program.moves.iter().map(|of| stacks[of.tool as usize].len()).sum();
        let bytes = bytes_of(program.moves.len(), count);
        if bytes > memory {
            let [bytes, memory] = [bytes, memory].map(|bytes| bytes.div_ceil(1 << 20));
            let moves = program.moves.len();
            return Err(Error::setting(
                format!(
                    "what {moves} moves sweep needs {bytes} MiB, of the {memory} MiB that there are for it"
                ),
                "allow more with `memory`, or give the program in parts, each for the store that the one before made",
            ));
        }
        cut.solids.reserve_exact(count);
        cut.moves.reserve_exact(count);
        for (number, of) in program.moves.iter().enumerate() {
            let stack = &stacks[of.tool as usize];
            cut.turn_error =
                cut.turn_error.max(turn_error(of, &program.tools[of.tool as usize].1, ball) / unit);
            for part in stack {
                cut.solids.push(solid(of, *part, origin, scale));
                cut.moves.push(number as u32);
            }
        }
        let corner = |(_, tool): &(u32, Tool)| match tool.kind {
            ToolKind::Bull { corner } => corner * (1.0 - (angle(1) * 0.5).cos()) / unit,
            _ => 0.0,
        };
        cut.corner_error = program.tools.iter().map(corner).fold(0.0, f64::max);
        Ok(cut)
    }

    /// Bytes that it takes with the moves of its program.
    pub fn bytes(&self, program: &Program) -> u64 {
        bytes_of(program.moves.len(), self.solids.len())
    }
}

/// Bytes of moves and of what they sweep, with the lists that name the solids of a node and of those around it.
fn bytes_of(moves: usize, solids: usize) -> u64 {
    const NUMBERS: usize = 8;
    let solid = size_of::<SweptSolid>() + (1 + NUMBERS) * size_of::<u32>();
    (moves * size_of::<Move>() + solids * solid) as u64
}

/// How far a tool that turns about its tip is from one that keeps its middle direction: each half of the step turns it by half
/// the angle at most. What cuts lies no farther from the tip than the far side of the ball around the root.
fn turn_error(of: &Move, tool: &Tool, (centre, radius): ([f64; 3], f64)) -> f64 {
    if of.turn == 0.0 {
        return 0.0;
    }
    let away = |p: [f64; 3]| (0..3).map(|a| (p[a] - centre[a]).powi(2)).sum::<f64>().sqrt() + radius;
    let reach = away(of.from).max(away(of.to));
    let tool = tool.length.map_or(reach, |length| reach.min(length.hypot(tool.diameter / 2.0)));
    2.0 * tool * (of.turn / 4.0).sin()
}

/// The angle of some steps of a corner.
fn angle(steps: usize) -> f64 {
    std::f64::consts::FRAC_PI_2 * steps as f64 / CORNER_STEPS as f64
}

/// The parts of a tool that has no length of its own but `reach`.
fn stack(tool: &Tool, reach: f64) -> Vec<Part> {
    let radius = tool.diameter / 2.0;
    let top = tool.length.unwrap_or(reach);
    let cone = |angle: f64, tip: f64| {
        let slope = (angle.to_radians() / 2.0).tan();
        let height = ((radius - tip) / slope).min(top);
        let mut parts = vec![Part::Frustum { height: [0.0, height], radius: [tip, tip + height * slope] }];
        if height < top {
            parts.push(Part::Frustum { height: [height, top], radius: [radius; 2] });
        }
        parts
    };
    let shaft =
        |from: f64| (from < top).then_some(Part::Frustum { height: [from, top], radius: [radius; 2] });
    match tool.kind {
        ToolKind::Ball => {
            std::iter::once(Part::Ball { height: radius, radius }).chain(shaft(radius)).collect()
        }
        ToolKind::Flat => shaft(0.0).into_iter().collect(),
        ToolKind::Bull { corner } => {
            let point = |n: usize| {
                let (sine, cosine) = angle(n).sin_cos();
                (corner * (1.0 - cosine), radius - corner + corner * sine)
            };
            let steps = (0..CORNER_STEPS).map(|n| {
                let (from, to) = (point(n), point(n + 1));
                Part::Frustum { height: [from.0, to.0], radius: [from.1, to.1] }
            });
            steps.chain(shaft(corner)).collect()
        }
        ToolKind::Drill { angle } => cone(angle, 0.0),
        ToolKind::Chamfer { angle, tip } => cone(angle, tip / 2.0),
    }
}

/// What a part of a tool sweeps on a move, in units.
fn solid(of: &Move, part: Part, origin: [f64; 3], scale: f64) -> SweptSolid {
    let axis = of.axis;
    let tip = [0, 1, 2].map(|a| (of.from[a] - origin[a]) * scale);
    let way = [0, 1, 2].map(|a| (of.to[a] - of.from[a]) * scale);
    SweptSolid::new(match part {
        Part::Ball { height, radius } => {
            let at = [0, 1, 2].map(|a| tip[a] + axis[a] * height * scale);
            ConvexSolid::Ball { at, way, radius: radius * scale }
        }
        Part::Frustum { height, radius } => ConvexSolid::Frustum {
            at: tip,
            way,
            frame: frame(axis),
            height: height.map(|c| c * scale),
            radius: radius.map(|c| c * scale),
        },
    })
}

/// A rotation whose last row is the tool's axis.
fn frame(axis: [f64; 3]) -> [[f64; 3]; 3] {
    if axis == [0.0, 0.0, 1.0] {
        return ConvexSolid::UPRIGHT;
    }
    let unit = |v: [f64; 3]| {
        let length = dot(v, v).sqrt();
        v.map(|c| c / length)
    };
    // The coordinate axis farthest from it.
    let least = (0..3).min_by(|&a, &b| axis[a].abs().total_cmp(&axis[b].abs())).unwrap_or(0);
    let mut other = [0.0; 3];
    other[least] = 1.0;
    let side = unit(cross(other, axis));
    [side, cross(axis, side), axis]
}
