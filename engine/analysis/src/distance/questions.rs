//! What is asked of the patches of a surface: the nearest point, the normal around, where a ray passes, how large a ball is.

use super::answers::{BallAt, Foot, Place};
use super::around::{AROUND, Around};
use super::boxes::{Block, Lanes, Normals, Probe, Question, WIDE, reciprocals};
use super::patch::{Patch, Shape, Touch};
use super::piece::Piece;
use super::sift::{PieceBall, within_reach};
use crate::lattice::{dot, minus};
use crate::wide::{Select, Simd, SimdBase, SimdMask, f32x8};

/// Feet that are as near as this part of their squares are equally near: of a crease, found from its two sides.
pub(super) const TIE: f64 = 2e-6;
/// The least depth of a point below the tangent plane, in cells, at which it bounds a ball that touches the plane on the same
/// side of the part: nearer ones tell nothing but errors.
const SHALLOW: f64 = 0.3;
/// Rays begin so many cells from their points.
const LEAVE: f64 = 1e-3;
/// A bent patch that reaches into a ball by less than so many cells and such a part of its radius does not shrink it: all that
/// touch the ball within a tube would be asked else. Of a ball whose contact is turned by a right angle and more the diameter
/// is right to twice this.
const INTO: f64 = 5e-4;
const INTO_PART: f64 = 2e-4;

/// Something to ask of all patches.
pub(super) trait PatchQuestion {
    /// Boxes are counted from `base` from now on, and their coordinates are at most `size` large.
    fn count_from(&mut self, base: [f64; 3], size: f32);

    /// See [`Question::nearness`].
    fn nearness<S: Simd>(&self, simd: S, boxes: &Lanes, normals: Option<&Normals>) -> f32x8<S>;

    /// See [`Question::counts`].
    fn counts(&self, nearness: f32) -> bool;

    /// See [`Question::sift`].
    #[inline(always)]
    fn sift<S: Simd>(&self, _simd: S, _piece: &Piece, _first: usize) -> u64 {
        u64::MAX
    }

    /// Looks at a patch; tells whether it changed what [`PatchQuestion::sift`] told.
    fn visit(&mut self, piece: &Piece, place: Place) -> bool;
}

/// A question to the patches of one piece.
pub(super) struct OfPiece<'a, Q> {
    pub piece: Piece<'a>,
    pub leaf: u32,
    pub question: &'a mut Q,
}

impl<Q: PatchQuestion> Question for OfPiece<'_, Q> {
    #[inline(always)]
    fn nearness<S: Simd>(&self, simd: S, boxes: &Lanes, normals: Option<&Normals>) -> f32x8<S> {
        self.question.nearness(simd, boxes, normals)
    }

    #[inline(always)]
    fn counts(&self, nearness: f32) -> bool {
        self.question.counts(nearness)
    }

    #[inline(always)]
    fn sift<S: Simd>(&self, simd: S, first: usize) -> u64 {
        self.question.sift(simd, &self.piece, first)
    }

    #[inline]
    fn visit(&mut self, thing: usize) -> bool {
        self.question.visit(&self.piece, Place { leaf: self.leaf, patch: thing as u32 })
    }
}

/// A limit in 32 bits that excludes nothing.
fn limit(most: f64) -> f32 {
    (most as f32).next_up()
}

/// The greatest number of 32 bits that is not above a number.
fn below(most: f64) -> f32 {
    let near = most as f32;
    if f64::from(near) > most { near.next_down() } else { near }
}

/// The pieces whose boxes meet a block, in order.
pub(super) struct PiecesIn {
    block: Block,
    found: Vec<usize>,
}

impl PiecesIn {
    pub fn new(block: Block) -> PiecesIn {
        PiecesIn { block, found: Vec::new() }
    }

    pub fn found(mut self) -> Vec<usize> {
        self.found.sort_unstable();
        self.found
    }
}

impl Question for PiecesIn {
    fn nearness<S: Simd>(&self, simd: S, boxes: &Lanes, _: Option<&Normals>) -> f32x8<S> {
        boxes.meeting(simd, &self.block)
    }

    fn counts(&self, _: f32) -> bool {
        true
    }

    fn visit(&mut self, piece: usize) -> bool {
        self.found.push(piece);
        false
    }
}

/// The nearest point: of points that are equally near, that of the patch that sees the place best. So in whatever order patches
/// are looked at, and whatever is known before, it is the same point.
pub(super) struct NearestQuery {
    from: [f64; 3],
    probe: Probe,
    /// The square of the least distance found, or allowed.
    within: f64,
    /// What is equally near.
    near: Vec<NearFoot>,
    /// The patch that was asked first.
    before: Option<Place>,
}

struct NearFoot {
    squared: f64,
    /// How well the patch sees the place: the cosine between its normal and the way to the place.
    aligned: f64,
    foot: Foot,
}

impl NearestQuery {
    pub fn new(from: [f64; 3], within: f64) -> NearestQuery {
        NearestQuery {
            from,
            probe: Probe::default(),
            within: within * within,
            near: Vec::new(),
            before: None,
        }
    }

    /// Asks a patch before all others, which bounds where these may be.
    pub fn begin(&mut self, piece: &Piece, place: Place) {
        self.visit(piece, place);
        self.before = Some(place);
    }

    fn take(&mut self, touch: Touch, local: [f64; 3], base: [f64; 3], place: Place) {
        let away = minus(local, touch.at);
        let distance = touch.squared.max(0.0).sqrt();
        let side = dot(away, touch.normal);
        let aligned = side.abs() / distance.max(f64::MIN_POSITIVE);
        if touch.squared < self.within {
            self.within = touch.squared;
            let most = self.most();
            self.near.retain(|near| near.squared <= most);
        }
        let at = std::array::from_fn(|a| touch.at[a] + base[a]);
        let foot = Foot { at, normal: touch.normal, distance, inside: side < 0.0, place };
        self.near.push(NearFoot { squared: touch.squared, aligned, foot });
    }

    /// The square of the distance up to which points count.
    fn most(&self) -> f64 {
        self.within * (1.0 + TIE)
    }

    /// The nearest point, if there was one.
    pub fn best(self) -> Option<Foot> {
        let better = |a: &NearFoot, b: &NearFoot| {
            a.aligned.total_cmp(&b.aligned).then(b.foot.place.cmp(&a.foot.place))
        };
        self.near.into_iter().max_by(better).map(|near| near.foot)
    }
}

impl PatchQuestion for NearestQuery {
    fn count_from(&mut self, base: [f64; 3], size: f32) {
        self.probe = Probe::new(minus(self.from, base), size);
    }

    #[inline(always)]
    fn nearness<S: Simd>(&self, simd: S, boxes: &Lanes, _: Option<&Normals>) -> f32x8<S> {
        boxes.squared_from(simd, &self.probe, limit(self.most()))
    }

    #[inline(always)]
    fn counts(&self, nearness: f32) -> bool {
        f64::from(nearness) <= self.most()
    }

    fn visit(&mut self, piece: &Piece, place: Place) -> bool {
        if self.before == Some(place) {
            return false;
        }
        let local = minus(self.from, piece.base);
        if let Some(touch) = piece.patch(place).nearest(piece.rings, local, self.most()) {
            self.take(touch, local, piece.base, place);
        }
        false
    }
}

/// The normal around a place.
pub(super) struct NormalAround {
    at: [f64; 3],
    probe: Probe,
    pub around: Around,
}

impl NormalAround {
    pub fn new(at: [f64; 3], normal: [f64; 3]) -> NormalAround {
        NormalAround { at, probe: Probe::default(), around: Around::new(at, normal) }
    }
}

impl PatchQuestion for NormalAround {
    fn count_from(&mut self, base: [f64; 3], size: f32) {
        self.probe = Probe::new(minus(self.at, base), size);
    }

    #[inline(always)]
    fn nearness<S: Simd>(&self, simd: S, boxes: &Lanes, _: Option<&Normals>) -> f32x8<S> {
        boxes.squared_from(simd, &self.probe, limit(AROUND * AROUND))
    }

    #[inline(always)]
    fn counts(&self, _: f32) -> bool {
        true
    }

    fn visit(&mut self, piece: &Piece, place: Place) -> bool {
        let patch = piece.patch(place);
        let crossing = std::array::from_fn(|a| f64::from(patch.at[a]) + piece.base[a]);
        if self.around.is_near(crossing) {
            let turned = patch.normal_at(minus(self.at, crossing));
            self.around.add(crossing, turned, patch.bend_size());
        }
        false
    }
}

/// Where a ray first passes the surface.
pub(super) struct RayQuery {
    from: [f64; 3],
    toward: [f64; 3],
    over: [f32; 3],
    probe: Probe,
    outward: bool,
    most: f64,
    pub first: Option<Foot>,
}

impl RayQuery {
    pub fn new(from: [f64; 3], toward: [f64; 3], most: f64, outward: bool) -> RayQuery {
        RayQuery {
            from,
            toward,
            over: reciprocals(toward),
            probe: Probe::default(),
            outward,
            most,
            first: None,
        }
    }
}

impl PatchQuestion for RayQuery {
    fn count_from(&mut self, base: [f64; 3], size: f32) {
        self.probe = Probe::new(minus(self.from, base), size);
    }

    #[inline(always)]
    fn nearness<S: Simd>(&self, simd: S, boxes: &Lanes, _: Option<&Normals>) -> f32x8<S> {
        boxes.entered(simd, &self.probe, self.over, limit(self.most))
    }

    #[inline(always)]
    fn counts(&self, nearness: f32) -> bool {
        f64::from(nearness) <= self.most
    }

    fn visit(&mut self, piece: &Piece, place: Place) -> bool {
        let local = minus(self.from, piece.base);
        let ray = (local, self.toward);
        let met = piece.patch(place).met(piece.rings, ray, [LEAVE, self.most], self.outward);
        if let Some((distance, normal)) = met {
            let at = along(self.from, self.toward, distance);
            self.most = distance;
            self.first = Some(Foot { at, normal, distance, inside: self.outward, place });
        }
        false
    }
}

/// The largest ball that touches a place and holds no surface.
///
/// A ball shrinks to what lies in it (Ma, Bae & Choi 2012). What lies beyond a box that the ball does not reach never bounds
/// it, since smaller balls lie within larger ones.
pub(super) struct Ball {
    at: [f64; 3],
    toward: [f64; 3],
    outward: [f64; 3],
    apart: f64,
    /// The same for boxes: a number of 32 bits is greater than `apart` if it is greater than this.
    apart_box: f32,
    pub radius: f64,
    centre: [f64; 3],
    pub contact: Option<Foot>,
    base: [f64; 3],
    size: f32,
    probe: Probe,
}

impl Ball {
    /// Not larger than `most`; surface whose normal is turned by less than `apart`, a cosine, does not count.
    pub fn new(BallAt { at, toward, outward }: BallAt, most: f64, apart: f64) -> Ball {
        let (base, size) = ([0.0; 3], 0.0);
        let centre = along(at, toward, most);
        let probe = Probe::default();
        let apart_box = below(apart);
        Ball { at, toward, outward, apart, apart_box, radius: most, centre, contact: None, base, size, probe }
    }

    /// The square of the distance from the centre below which a patch shrinks the ball.
    fn within(&self, shape: Shape) -> f64 {
        let least = match shape {
            Shape::Bent => (self.radius * (1.0 - INTO_PART) - INTO).max(0.0),
            Shape::Plane | Shape::Rough => self.radius,
        };
        least * least
    }

    /// Shrinks until the patch has no point in it.
    fn shrink(&mut self, piece: &Piece, patch: &Patch, place: Place) {
        const STEPS: usize = 8;
        let local = minus(self.at, piece.base);
        for _ in 0..STEPS {
            let centre = minus(self.centre, piece.base);
            let Some(touch) = patch.nearest(piece.rings, centre, self.within(patch.shape())) else { return };
            let away = minus(touch.at, local);
            let depth = dot(away, self.toward);
            let facing = dot(touch.normal, self.outward);
            if facing > self.apart || depth <= 0.0 || (facing > 0.0 && depth < SHALLOW) {
                return;
            }
            let radius = 0.5 * dot(away, away) / depth;
            if radius >= self.radius * (1.0 - 1e-12) {
                return;
            }
            let at = std::array::from_fn(|a| touch.at[a] + piece.base[a]);
            let distance = dot(away, away).sqrt();
            self.contact = Some(Foot { at, normal: touch.normal, distance, inside: true, place });
            let is_done = radius > self.radius * (1.0 - 1e-7);
            self.radius = radius;
            self.centre = along(self.at, self.toward, radius);
            if is_done {
                return;
            }
        }
    }
}

impl PatchQuestion for Ball {
    fn count_from(&mut self, base: [f64; 3], size: f32) {
        (self.base, self.size) = (base, size);
        self.probe = Probe::new(minus(self.centre, base), size);
    }

    #[inline(always)]
    fn nearness<S: Simd>(&self, simd: S, boxes: &Lanes, normals: Option<&Normals>) -> f32x8<S> {
        let near = boxes.squared_from(simd, &self.probe, limit(self.radius * self.radius));
        let far = f32x8::splat(simd, f32::INFINITY);
        let Some(normals) = normals.filter(|_| near.simd_lt(far).any_true()) else { return near };
        let [x, y, z] = self.outward;
        let cosines = normals.least_cosines(simd, [x as f32, y as f32, z as f32]);
        let near = cosines.simd_gt(f32x8::splat(simd, self.apart_box)).select(far, near);
        if !near.simd_lt(far).any_true() {
            return near;
        }
        boxes.reached(simd, normals, (&self.probe, limit(self.radius)), near)
    }

    #[inline(always)]
    fn sift<S: Simd>(&self, simd: S, piece: &Piece, first: usize) -> u64 {
        let within = [self.within(Shape::Bent), self.within(Shape::Plane)];
        let centre = minus(self.centre, piece.base);
        let ball = PieceBall { centre, outward: self.outward, apart: self.apart, within };
        let last = (first + WIDE).min(piece.patches.len());
        within_reach(simd, &piece.patches[first..last], &ball)
    }

    /// The centre may have moved since, so that boxes have to be asked again.
    #[inline(always)]
    fn counts(&self, _: f32) -> bool {
        true
    }

    fn visit(&mut self, piece: &Piece, place: Place) -> bool {
        let patch = piece.patch(place);
        if dot(patch.normal.map(f64::from), self.outward) - f64::from(patch.turn()) > self.apart {
            return false;
        }
        let radius = self.radius;
        self.shrink(piece, patch, place);
        if self.radius != radius {
            self.probe = Probe::new(minus(self.centre, self.base), self.size);
        }
        self.radius != radius
    }
}

fn along(at: [f64; 3], toward: [f64; 3], length: f64) -> [f64; 3] {
    std::array::from_fn(|a| at[a] + length * toward[a])
}
