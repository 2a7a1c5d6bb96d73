//! Splats to pixels on the device, some tiles at a time.

use super::device::Gpu;
use super::exchange::{BufferLayout, BufferSet};
use super::failure::DeviceFailure;
use super::kernels::{DescriptorSets, Kernels};
use super::memory::in_a_row;
use super::slot::BatchSlot;
use super::splat_batch::{SplatBatch, SplatCapacity};
use ash::vk;
use brickfield_shaders::{
    RASTER, SPLAT_BUFFERS, STEPS_MAX, SplatTile, SplatView, TILE, TileSplat, WORKGROUP,
};

/// Kernels by number.
const NEAREST: usize = 0;
const BLEND: usize = 1;
/// Buffers that are uploaded; the last is read back.
const UPLOADED: usize = SPLAT_BUFFERS.len() - 1;
/// Sizes of cells: there are fewer levels.
const SIZES_MAX: usize = 32;
/// Pixels of a tile, each with an invocation of a workgroup.
const TILE_PIXELS: usize = (TILE * TILE) as usize;
const PIXEL_BYTES: usize = 16;
/// Tiles and splats at most: 25 MB.
const ROOM: SplatCapacity = SplatCapacity { tiles: 1 << 12, splats: 1 << 18 };
/// How often they can be halved: to four tiles and 256 splats.
const HALVINGS: u32 = 10;

impl SplatCapacity {
    /// The most that fits in so many bytes, at least some splats of some tiles.
    fn within(bytes: u64, range_max: u64, stages: bool) -> Option<SplatCapacity> {
        let rooms =
            (0..=HALVINGS).map(|n| SplatCapacity { tiles: ROOM.tiles >> n, splats: ROOM.splats >> n });
        rooms.into_iter().find(|room| {
            let layout = room.layout();
            layout.is_seen(range_max) && layout.total_bytes(stages) <= bytes
        })
    }

    /// Where the parts of a buffer lie.
    fn layout(&self) -> BufferLayout<{ SPLAT_BUFFERS.len() }> {
        let lengths = [
            size_of::<SplatView>(),
            SIZES_MAX * size_of::<[f32; 4]>(),
            self.tiles * size_of::<SplatTile>(),
            self.splats * size_of::<TileSplat>(),
            self.tiles * TILE_PIXELS * PIXEL_BYTES,
        ];
        let ranges = in_a_row(lengths.map(|length| length as u64));
        BufferLayout { ranges, written: UPLOADED, read: &[UPLOADED] }
    }
}

/// Draws splats in tiles, in as many parts as there are.
pub struct SplatDrawer {
    // Dropped first: it waits for the device.
    slot: BatchSlot,
    buffers: BufferSet,
    sets: DescriptorSets,
    kernels: Kernels,
    gpu: Gpu,
    room: SplatCapacity,
}

impl SplatDrawer {
    /// Kernels, and as much room as there may be.
    ///
    /// # Errors
    /// If the device has less memory than that of the smallest part, or fails.
    pub fn new(gpu: &Gpu) -> Result<SplatDrawer, DeviceFailure> {
        gpu.check()?;
        let context = &gpu.context;
        let hardware = &context.hardware;
        let left = hardware.cap.saturating_sub(hardware.allocated().0);
        let room = SplatCapacity::within(left, hardware.range_max, !hardware.shares_memory())
            .ok_or(DeviceFailure::OutOfMemory)?;
        let entries = [(RASTER, c"nearest"), (RASTER, c"blend")];
        let kernels = Kernels::new(context, SPLAT_BUFFERS.len(), &entries)?;
        let buffers = BufferSet::new(context, &room.layout(), 1)?;
        let sets = kernels.sets(1)?;
        sets.point(0, 0, buffers.buffer(0), buffers.ranges());
        Ok(SplatDrawer { slot: BatchSlot::new(context)?, buffers, sets, kernels, gpu: gpu.clone(), room })
    }

    /// How much is drawn together at most.
    pub fn room(&self) -> SplatCapacity {
        self.room
    }

    /// Draws tiles that have all of their splats.
    ///
    /// # Errors
    /// If the device fails.
    ///
    /// # Panics
    /// If there is no tile, no room, or something beyond what is there.
    pub fn draw(&mut self, input: &SplatBatch) -> Result<(), DeviceFailure> {
        self.run(input, true, &[NEAREST, BLEND])
    }

    /// Finds the nearest among some of the tiles' splats, and among those of earlier calls unless they are the `first`. Tiles
    /// with more splats than are drawn at once come in several calls, and once more all of them to [`SplatDrawer::blend`].
    ///
    /// # Errors
    /// If the device fails.
    ///
    /// # Panics
    /// As [`SplatDrawer::draw`].
    pub fn find_nearest(&mut self, input: &SplatBatch, first: bool) -> Result<(), DeviceFailure> {
        self.run(input, first, &[NEAREST])
    }

    /// Adds up what lies with the nearest among some of the tiles' splats.
    ///
    /// # Errors
    /// If the device fails.
    ///
    /// # Panics
    /// As [`SplatDrawer::draw`].
    pub fn blend(&mut self, input: &SplatBatch) -> Result<(), DeviceFailure> {
        self.run(input, false, &[BLEND])
    }

    /// What became of the first tiles' pixels: the sum of normals by weight, and how far along the ray the nearest splat is,
    /// 1e30 where there is none.
    ///
    /// # Panics
    /// If there is no room for so many tiles.
    pub fn pixels(&self, tiles: usize) -> &[[f32; 4]] {
        bytemuck::cast_slice(self.buffers.bytes(0, 0, (tiles * TILE_PIXELS * PIXEL_BYTES) as u64))
    }

    fn run(&mut self, input: &SplatBatch, first: bool, passes: &[usize]) -> Result<(), DeviceFailure> {
        self.check(input);
        self.gpu.check()?;
        let view = SplatView { first: first.into(), ..input.view };
        let parts: [&[u8]; UPLOADED] = [
            bytemuck::bytes_of(&view),
            bytemuck::cast_slice(&input.sizes),
            bytemuck::cast_slice(&input.tiles),
            bytemuck::cast_slice(&input.splats),
        ];
        let end = input.tiles.iter().map(|tile| tile.pixels_from as usize).max().unwrap_or(0) + TILE_PIXELS;
        let upload = self.buffers.write(0, &parts, Vec::new());
        let read_back = self.buffers.read_back(0, &[(end * PIXEL_BYTES) as u64]);
        let (kernels, set) = (&self.kernels, self.sets.sets[0]);
        let groups = [input.tiles.len() as u32, 1];
        self.slot.run(|slot| {
            upload.record(slot);
            for pass in passes {
                // It goes on with what the one before has left, in this run or in the last.
                slot.barrier(vk::PipelineStageFlags::COMPUTE_SHADER, vk::PipelineStageFlags::COMPUTE_SHADER);
                slot.dispatch(kernels, *pass, set, groups);
            }
            read_back.record(slot);
        })?;
        self.slot.wait()
    }

    /// Every number that a kernel takes for an index lies within what it indexes.
    fn check(&self, input: &SplatBatch) {
        const { assert!(TILE_PIXELS == WORKGROUP as usize) };
        let SplatBatch { sizes, tiles, splats, .. } = input;
        assert!(
            (1..=self.room.tiles).contains(&tiles.len())
                && splats.len() <= self.room.splats
                && sizes.len() <= SIZES_MAX,
            "the tiles do not fit"
        );
        let is_sound = |tile: &SplatTile| {
            tile.splats <= STEPS_MAX
                && tile.splats_from as usize + tile.splats as usize <= splats.len()
                && tile.pixels_from as usize + TILE_PIXELS <= self.room.tiles * TILE_PIXELS
        };
        assert!(tiles.iter().all(is_sound), "a splat or pixel that is not there");
        assert!(splats.iter().all(|splat| (splat.size as usize) < sizes.len()), "a size that is not there");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_fit_their_memory() {
        assert_eq!(SplatCapacity::within(1 << 30, 1 << 27, true), Some(ROOM));
        for bytes in [60_000, 400_000, 1 << 20, 20 << 20] {
            let room = SplatCapacity::within(bytes, 1 << 27, true).unwrap();
            assert!(room.layout().total_bytes(true) <= bytes && room.tiles > 0);
            assert!(room.of_tile() == room.splats.min(STEPS_MAX as usize) && room.of_tile() >= 256);
        }
        assert_eq!(SplatCapacity::within(20_000, 1 << 27, true), None);
        assert_eq!(SplatCapacity::within(1 << 30, 10_000, true), None);
    }
}
