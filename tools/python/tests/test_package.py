"""Tests of the Python package, run by run.py in an environment where the wheel is installed."""

import doctest
import importlib.util
import os
import re
import signal
import subprocess
import sys
import tempfile
import threading
import time
import unittest
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from pathlib import Path

import numpy as np

import brickfield
import brickfield.distributed

TOP = Path(__file__).resolve().parents[3]
CLOVER = TOP / "bench-data" / "clover.gcode"


def cube(at: float, edge: float) -> tuple[np.ndarray, np.ndarray]:
    """A cube whose lowest corner is (at, at, at)."""
    vertices = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)], dtype=float) * edge + at
    quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
    return vertices, np.array([t for a, b, c, d in quads for t in ([a, b, c], [a, c, d])])


class Arrays(unittest.TestCase):
    def test_two_cubes_count(self) -> None:
        part = brickfield.build([cube(0, 4), cube(2, 4)], depth=2)
        points = np.random.default_rng(1).uniform(-1, 7, (10_000, 3))
        # Samples are exact; between them w is interpolated, so only points far from faces are asked.
        far = np.all(np.abs(points[:, :, None] - np.array([0, 2, 4, 6])).min(axis=2) > 0.2, axis=1)
        inside = [np.all((points > low) & (points < low + 4), axis=1) for low in (0, 2)]
        expected = inside[0].astype(np.float32) + inside[1]
        np.testing.assert_array_equal(part.sample(points)[far], expected[far])
        np.testing.assert_array_equal(
            sum(brickfield.winding(*cube(low, 4), points) for low in (0, 2)), expected
        )
        volumes = part.volumes()
        self.assertLessEqual(abs(volumes["union"] - 120), volumes["union_error"])
        self.assertEqual(part.range, (0, 2))
        self.assertIsNone(part.path)

    def test_views_and_types(self) -> None:
        vertices, triangles = cube(0, 4)
        one = brickfield.winding(vertices, triangles, [[1, 1, 1]])
        for v, t in [
            (np.asfortranarray(vertices), triangles.astype(np.uint8)),
            (np.repeat(vertices, 2, axis=1)[:, ::2], triangles[:, :]),
            (vertices.astype(np.float32), triangles.astype(np.int32)),
        ]:
            np.testing.assert_array_equal(brickfield.winding(v, t, [[1, 1, 1]]), one)
        with self.assertRaises(ValueError):
            brickfield.winding(vertices, triangles.astype(float), [[1, 1, 1]])
        with self.assertRaises(ValueError):
            brickfield.winding(vertices, triangles - 1, [[1, 1, 1]])
        with self.assertRaises(ValueError):
            brickfield.winding(vertices, triangles, [[1, 1]])
        with self.assertRaises(brickfield.Error):
            brickfield.winding(vertices, triangles + 5, [[1, 1, 1]])

    def test_open_triangles_have_fractions(self) -> None:
        vertices, triangles = cube(0, 4)
        w = brickfield.winding(vertices, triangles[:-2], [[2.0, 2.0, 2.0]])
        # A side of a cube is a sixth of the sphere seen from its middle.
        self.assertAlmostEqual(w[0], 5 / 6, places=6)

    def test_settings_are_those_of_the_program(self) -> None:
        vertices, triangles = cube(0, 4)
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            source = folder / "cube.obj"
            rows = [f"v {x} {y} {z}" for x, y, z in vertices] + [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in triangles]
            source.write_text("\n".join(rows) + "\n")
            settings = {"depth": 4, "boundary_error": 0.1, "unit": "cm", "threads": 1, "memory": "1GiB"}
            part = brickfield.build(source, folder / "a.brf", **settings)
            brickfield.run("build", source, "-o", folder / "b.brf", *brickfield._program.options_of(settings))
            seen: list[str] = []
            brickfield.build(source, folder / "c.brf", **{**settings, "boundary_error": "0.1cm"}, refine="hidden",
                             progress=lambda phase, *_: seen.append(phase))
            self.assertEqual(part.unit, "cm")
            self.assertTrue(seen)
            one = (folder / "a.brf").read_bytes()
            self.assertEqual(one, (folder / "b.brf").read_bytes())
            self.assertEqual(one, (folder / "c.brf").read_bytes())
            for inputs, out in [((vertices, triangles), folder / "d.brf"), (source, None)]:
                with self.assertRaisesRegex(brickfield.Error, "cell: for files"):
                    brickfield.build(inputs, out, cell="1mm")
            with self.assertRaisesRegex(brickfield.Error, "--dephts"):
                brickfield.build(source, folder / "d.brf", dephts=3)

    def test_points_become_a_sphere(self) -> None:
        n = np.arange(2000) + 0.5
        polar, turn = np.arccos(1 - 2 * n / 2000), np.pi * (1 + 5**0.5) * n
        normals = np.stack([np.cos(turn) * np.sin(polar), np.sin(turn) * np.sin(polar), np.cos(polar)], axis=1)
        part = brickfield.build((normals * 5, normals), depth=1)
        self.assertLess(abs(part.sample([[0, 0, 0]])[0] - 1), 0.05)


class Stores(unittest.TestCase):
    folder: tempfile.TemporaryDirectory
    part: brickfield.Octree

    @classmethod
    def setUpClass(cls) -> None:
        cls.folder = tempfile.TemporaryDirectory()
        cls.part = brickfield.build(CLOVER, Path(cls.folder.name) / "clover.brf", depth=2, identity=True)

    @classmethod
    def tearDownClass(cls) -> None:
        cls.folder.cleanup()

    def test_levels_are_read_where_they_are_asked(self) -> None:
        part = brickfield.open(self.part.path)
        level = part.level(2)
        before = part.bricks_read
        box = level[40:44, 50:60, 33:35]
        self.assertEqual(box.shape, (4, 10, 2))
        self.assertEqual(part.bricks_read - before, 1)
        whole = np.asarray(level)
        self.assertEqual(whole.shape, (128, 128, 128))
        np.testing.assert_array_equal(whole[40:44, 50:60, 33:35], box)
        np.testing.assert_array_equal(whole[3, ..., ::5], level[3, ..., ::5])
        np.testing.assert_array_equal(whole[-1, 4], level[-1, 4])
        self.assertEqual(float(level[64, 64, 64]), whole[64, 64, 64])
        np.testing.assert_array_equal(np.asarray(part.level(1)), whole[::2, ::2, ::2])
        npy = Path(self.folder.name) / "w.npy"
        part.export(npy, "--level", "2", "--dtype", "f4")
        np.testing.assert_array_equal(np.load(npy), whole)
        points = np.array(level.origin) + level.spacing * np.argwhere(whole > 0)[::97, ::-1]
        np.testing.assert_array_equal(part.sample(points), whole[whole > 0][::97])
        with self.assertRaises(IndexError):
            level[128]
        with self.assertRaises(brickfield.Error):
            part.level(3)

    def test_a_box_reads_the_bricks_it_needs(self) -> None:
        part = brickfield.open(self.part.path)
        level = part.level(2)
        # Bricks of 32³ samples, four along each axis.
        for box, bricks in [(np.s_[0:32, 64:96, 32:64], 1), (np.s_[31:33, 63:65, 95:97], 8), (np.s_[40], 16)]:
            before = part.bricks_read
            level[box]
            self.assertLessEqual(part.bricks_read - before, bricks)

    def test_tables_are_columns(self) -> None:
        layers = self.part.layers()
        self.assertTrue((np.diff(layers["z_top"]) > 0).all())
        self.assertEqual(len(layers["area"]), len(layers["layer"]))
        self.assertIn("volume", self.part.overlap())
        all, none = self.part.voids(), self.part.voids("--min-volume", "999999")
        self.assertEqual(list(all), list(none))
        self.assertEqual(len(none["id"]), 0)
        self.assertEqual((all["volume"].dtype.kind, all["throat"].dtype.kind, all["class"].dtype.kind), ("f", "f", "U"))

    def test_machining_gives_a_store_and_columns(self) -> None:
        moves = TOP / "bench-data" / "machining" / "clover.nc"
        cut, opened = self.part.machine(moves, Path(self.folder.name) / "cut.brf")
        self.assertLess(cut.volumes()["union"], self.part.volumes()["union"])
        self.assertEqual(list(opened)[:5], ["id", "volume", "state", "ligament", "move_first"])
        self.assertLessEqual(set(opened["state"]), {"untouched", "opened", "consumed"})

    def test_distances_are_columns(self) -> None:
        with tempfile.TemporaryDirectory() as folder:
            part = brickfield.build(cube(0, 4), Path(folder) / "cube.brf", depth=2)
            walls = part.thickness("--method", "ray")
            self.assertEqual(list(walls), ["x", "y", "z", "thickness"])
            self.assertAlmostEqual(float(np.median(walls["thickness"])), 4, places=3)
            larger = part.offset(Path(folder) / "larger.brf", "--by", "0.5mm")
            apart = larger.deviation(part.path)
            self.assertAlmostEqual(float(np.median(apart["deviation"])), 0.5, places=3)
            half = part.csg(Path(folder) / "half.brf", "--minus", "z>2mm")
            volumes = half.volumes()
            self.assertLessEqual(abs(volumes["union"] - 32), volumes["union_error"])
            with self.assertRaises(brickfield.Error):
                part.csg(Path(folder) / "none.brf", "--minus", "prism 3")

    def test_meshes_and_pictures(self) -> None:
        vertices, triangles = self.part.mesh()
        edges = np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1)
        self.assertTrue((np.unique(edges, axis=0, return_counts=True)[1] == 2).all())
        self.assertLess(triangles.max(), len(vertices))
        corners = vertices.astype(float)[triangles]
        facing = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        again, same, normals = self.part.mesh(normals=True)
        np.testing.assert_array_equal(again, vertices)
        np.testing.assert_array_equal(same, triangles)
        self.assertEqual(normals.shape, vertices.shape)
        np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-6)
        # Normals look outward, as most triangles at their vertices do.
        self.assertGreater((np.einsum("ij,ij->i", facing, normals[triangles[:, 0]]) > 0).mean(), 0.8)
        _, numbered, of_beads = self.part.mesh(attributes=["bead", "feature"])
        np.testing.assert_array_equal(numbered, triangles)
        self.assertEqual([len(column) for column in of_beads.values()], [len(triangles)] * 2)
        self.assertIn("Internal infill", of_beads["feature"])
        coarse, _ = self.part.mesh(tolerance=1.0)
        self.assertLess(len(coarse), len(vertices))
        for pixels in (self.part.slice(z=5.0), self.part.render()):
            self.assertEqual((pixels.ndim, pixels.shape[2], pixels.dtype), (3, 3, np.uint8))
            self.assertGreater(len(np.unique(pixels)), 2)

    @unittest.skipUnless(importlib.util.find_spec("trimesh"), "trimesh is not installed")
    def test_trimesh_takes_the_mesh(self) -> None:
        mesh = self.part.to_trimesh()
        self.assertTrue(mesh.is_watertight)
        volumes = self.part.volumes()
        self.assertLess(abs(mesh.volume - volumes["union"]), volumes["union_error"])

    @unittest.skipUnless(importlib.util.find_spec("pyvista"), "pyvista is not installed")
    def test_pyvista_takes_the_mesh(self) -> None:
        mesh = self.part.to_pyvista()
        self.assertEqual(mesh.n_open_edges, 0)
        volumes = self.part.volumes()
        self.assertLess(abs(mesh.volume - volumes["union"]), volumes["union_error"])

    @unittest.skipUnless(importlib.util.find_spec("pandas"), "pandas is not installed")
    def test_pandas_takes_columns(self) -> None:
        import pandas

        table = pandas.DataFrame(self.part.layers())
        self.assertEqual(list(table.columns[:2]), ["layer", "z_bottom"])

    def test_errors_tell_kind_and_path(self) -> None:
        with self.assertRaises(brickfield.Error) as raised:
            brickfield.open("none.brf")
        self.assertEqual((raised.exception.kind, raised.exception.path), ("io", "none.brf"))
        with self.assertRaises(brickfield.Error) as raised:
            brickfield.build(CLOVER, depth=99)
        self.assertEqual(raised.exception.kind, "setting")
        self.assertNotIn("\n", str(raised.exception))

    def test_progress_and_what_it_raises(self) -> None:
        seen: list[str] = []

        def progress(phase: str, done: int, total: int | None) -> None:
            seen.append(phase)
            if len(seen) > 1:
                raise RuntimeError("enough")

        out = Path(self.folder.name) / "stopped.brf"
        with self.assertRaisesRegex(RuntimeError, "enough"):
            brickfield.build(CLOVER, out, depth=6, progress=progress)
        self.assertTrue(seen)
        self.assertFalse(out.exists())

    def test_an_interrupt_stops_the_work(self) -> None:
        # Python leaves it ignored where it was, as in a job in the background.
        signal.signal(signal.SIGINT, signal.default_int_handler)
        threading.Timer(0.3, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
        begun = time.time()
        with self.assertRaises(KeyboardInterrupt):
            brickfield.build(CLOVER, Path(self.folder.name) / "long.brf", depth=8)
        self.assertLess(time.time() - begun, 60)

    def test_the_program_is_there(self) -> None:
        done = subprocess.run([sys.executable, "-m", "brickfield", "--version"], capture_output=True, text=True)
        self.assertIn("brickfield", done.stdout)
        wrong = subprocess.run([sys.executable, "-m", "brickfield", "info", "none.brf"], capture_output=True, text=True)
        self.assertEqual(wrong.returncode, 1)
        self.assertEqual(len(wrong.stderr.splitlines()), 1)


#: As an OBJ file, the last face last.
TETRAHEDRON = "v 0 0 0\nv 9 0 0\nv 0 9 0\nv 0 0 9\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"


class Shards(unittest.TestCase):
    def one_build(self, folder: Path) -> tuple[Path, Path]:
        """A mesh, and where its shards are to be joined to the bytes of ``one.brf``."""
        source = folder / "a.obj"
        source.write_text(TETRAHEDRON)
        brickfield.run("build", source, "-o", folder / "one.brf", "--depth", "3")
        return source, folder / "a.brf"

    def test_what_is_finished_is_kept(self) -> None:
        with tempfile.TemporaryDirectory() as name, ThreadPoolExecutor(2) as pool:
            folder = Path(name)
            build = brickfield.distributed.build
            source, out = self.one_build(folder)
            place = folder / "shards"
            blocked = place / "shard-2-of-3.brf"
            blocked.mkdir(parents=True)
            with self.assertRaisesRegex(brickfield.Error, "shard 2 of 3: .*2 of 3 shards are kept") as caught:
                build(source, out, client=pool, shards=3, folder=place, depth=3)
            self.assertEqual((caught.exception.kind, caught.exception.path), ("program", str(blocked)))
            with self.assertRaisesRegex(brickfield.Error, "other inputs or settings"):
                build(source, out, client=pool, shards=3, folder=place, depth=2)
            blocked.rmdir()
            steps: list[tuple[int, int]] = []
            build(source, out, client=pool, shards=3, folder=place, depth=3, progress=lambda *n: steps.append(n))
            self.assertEqual(steps, [(3, 3)])
            self.assertEqual(out.read_bytes(), (folder / "one.brf").read_bytes())
            self.assertFalse(place.exists())

    def test_damaged_and_missing_shards_are_built_again(self) -> None:
        with tempfile.TemporaryDirectory() as name, ThreadPoolExecutor(2) as pool:
            folder = Path(name)
            source, out = self.one_build(folder)
            place = folder / "shards"
            settings = {"client": pool, "shards": 3, "folder": place, "depth": 3}
            blocked = place / "shard-3-of-3.brf"
            blocked.mkdir(parents=True)
            with self.assertRaisesRegex(brickfield.Error, "shard 3 of 3: "):
                brickfield.distributed.build(source, out, **settings)
            blocked.rmdir()
            (place / "shard-1-of-3.brf").unlink()
            second = place / "shard-2-of-3.brf"
            damaged = bytearray(second.read_bytes())
            damaged[len(damaged) // 2] ^= 1
            second.write_bytes(damaged)
            with self.assertRaisesRegex(brickfield.Error, "shard 2 of 3: .*it is removed") as caught:
                brickfield.distributed.build(source, out, **settings)
            self.assertEqual(caught.exception.path, str(second))
            steps: list[tuple[int, int]] = []
            brickfield.distributed.build(source, out, **settings, progress=lambda *n: steps.append(n))
            self.assertEqual(steps, [(3, 3)])
            self.assertEqual(out.read_bytes(), (folder / "one.brf").read_bytes())

    def test_a_shard_of_another_part_is_named(self) -> None:
        with tempfile.TemporaryDirectory() as name, ThreadPoolExecutor(2) as pool:
            folder = Path(name)
            source, out = self.one_build(folder)
            place = folder / "shards"
            other = place / "shard-2-of-3.brf"
            place.mkdir()
            brickfield.run("build", source, "-o", other, "--depth", "2", "--shard", "2/3")
            with self.assertRaisesRegex(brickfield.Error, "shard-2-of-3"):
                brickfield.distributed.build(source, out, client=pool, shards=3, folder=place, depth=3)
            self.assertFalse(out.exists())

    def test_a_worker_that_dies_is_told(self) -> None:
        with tempfile.TemporaryDirectory() as name:
            folder, steps = Path(name), []
            settings = {"shards": 3, "depth": 5}
            with ProcessPoolExecutor(1) as pool:
                worker = pool.submit(os.getpid).result()
                # Its first shard is finished, the second one is in work.
                kill = lambda *n: (steps.append(n), time.sleep(0.3), os.kill(worker, signal.SIGKILL))
                with self.assertRaisesRegex(brickfield.Error, "shard 2 of 3: .*process.*1 of 3 shards are kept"):
                    brickfield.distributed.build(CLOVER, folder / "a.brf", client=pool, **settings, progress=kill)
            with ThreadPoolExecutor(2) as pool:
                again: list[tuple[int, int]] = []
                brickfield.distributed.build(
                    CLOVER, folder / "a.brf", client=pool, **settings, progress=lambda *n: again.append(n)
                )
            self.assertEqual((steps, again), ([(1, 3)], [(2, 3), (3, 3)]))
            brickfield.run("build", CLOVER, "-o", folder / "one.brf", "--depth", "5")
            self.assertEqual((folder / "a.brf").read_bytes(), (folder / "one.brf").read_bytes())

    def test_a_client_that_is_cut_off_is_told(self) -> None:
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            source, out = self.one_build(folder)
            pool = ThreadPoolExecutor(1)
            pool.shutdown()
            with self.assertRaisesRegex(brickfield.Error, "the client does not answer: .*0 of 3 shards are kept"):
                brickfield.distributed.build(source, out, client=pool, shards=3, depth=3)

    def test_a_plan_is_made_once(self) -> None:
        with tempfile.TemporaryDirectory() as name, ThreadPoolExecutor(2) as pool:
            folder = Path(name)
            build = brickfield.distributed.build
            source, out = self.one_build(folder)
            build(source, out, client=pool, shards=3, depth=3, memory="1GiB", plan=True)
            self.assertEqual(out.read_bytes(), (folder / "one.brf").read_bytes())
            source.write_text(TETRAHEDRON.removesuffix("f 2 3 4\n"))
            with self.assertRaisesRegex(brickfield.Error, "the plan: .*the surface is open"):
                build(source, out, client=pool, shards=3, depth=3, plan=True)


class Memory(unittest.TestCase):
    def test_a_thousand_builds_leak_nothing(self) -> None:
        def resident() -> int:
            return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")

        vertices, triangles = cube(0, 4)
        for n in range(1000):
            brickfield.build((vertices, triangles), depth=0)
            if n == 200:
                before = resident()
        self.assertLess(resident() - before, 8 << 20)


class Guide(unittest.TestCase):
    """Examples of the documentation, page by page in a folder that has the files they name."""

    def test_snippets_run(self) -> None:
        page = TOP / "docs" / "guide" / "python.md"
        snippets = re.findall(r"```python\n(.*?)```", page.read_text(), re.DOTALL)
        self.assertGreaterEqual(len(snippets), 10)
        told: list[str] = []
        runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE)
        here = os.getcwd()
        with tempfile.TemporaryDirectory() as name:
            os.chdir(name)
            try:
                Path("part.gcode").write_bytes(CLOVER.read_bytes())
                Path("face.nc").write_bytes((TOP / "bench-data" / "machining" / "clover.nc").read_bytes())
                names: dict[str, object] = {}
                for number, snippet in enumerate(snippets, 1):
                    self.assertIn(">>> ", snippet)
                    test = doctest.DocTestParser().get_doctest(snippet, names, f"snippet {number}", str(page), 0)
                    runner.run(test, out=told.append, clear_globs=False)
                    names = test.globs
            finally:
                os.chdir(here)
        self.assertEqual(runner.failures, 0, "".join(told))


def load_tests(loader: unittest.TestLoader, tests: unittest.TestSuite, _: object) -> unittest.TestSuite:
    vertices = np.array([[0, 0, 0], [10, 0, 0], [0, 10, 0], [0, 0, 10]], dtype=float)
    triangles = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    tests.addTests(doctest.DocTestSuite(brickfield, extraglobs={"VERTICES": vertices, "TRIANGLES": triangles}))
    tests.addTests(doctest.DocTestSuite(brickfield._program))
    tests.addTests(doctest.DocTestSuite(brickfield.distributed))
    return tests


if __name__ == "__main__":
    unittest.main()
