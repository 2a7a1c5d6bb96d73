#!/usr/bin/env python3
"""Writes the volumes beside it with the programs that users have: `make.py vdb` by OpenVDB (Debian's python3-openvdb),
`make.py vti` by VTK and SimpleITK (of PyPI). The tests know the formulas of their values."""

import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent


def number(x, y, z):
    """Value of an active voxel."""
    return (x * 31 + y * 17 + z * 7) % 101 / 8


def inactive(leaf, x, y, z):
    """Value of a voxel that is not active: a kind of node for each leaf along x."""
    return [3, -3, 5, [3, -3][y % 2], [3, 5][y % 2], [5, 7][y % 2], [5, 7, 9][y % 3]][leaf]


def write_vdb():
    import pyopenvdb as vdb

    def codes(kind, shift, **flags):
        grid = kind(3)
        to = grid.getAccessor()
        for x in range(56):
            for y in range(8):
                for z in range(8):
                    place = tuple(c + s for c, s in zip((x, y, z), shift))
                    if (x + y + z) % 2:
                        to.setValueOff(place, inactive(x // 8, x, y, z))
                    else:
                        to.setValueOn(place, number(x, y, z))
        for low, size, value, active in [
            ((0, 64, 0), 16, 4, True),
            ((64, 64, 0), 8, 6, False),
            ((128, 0, 0), 128, 1.5, True),
        ]:
            high = tuple(c + s + size - 1 for c, s in zip(low, shift))
            grid.fill(tuple(c + s for c, s in zip(low, shift)), high, value, active)
        for name, value in flags.items():
            setattr(grid, name, value)
        return grid

    origin = (0, 0, 0)
    floats, halves = codes(vdb.FloatGrid, origin, name="codes"), codes(vdb.FloatGrid, origin, name="halves")
    halves.saveFloatAsHalf = True
    below = codes(vdb.FloatGrid, (-256, -4096, 4096), name="below")
    vdb.write(str(HERE / "codes.vdb"), [floats, halves, below])

    ball = vdb.createLevelSetSphere(radius=2.0, center=(1, 2, 3), voxelSize=0.5)
    ball.name = "ball"
    fog = vdb.FloatGrid(0)
    fog.name, fog.gridClass = "fog", "fog volume"
    fog.fill((3, 4, 5), (20, 12, 30), 1.0)
    fog.transform = vdb.createLinearTransform([[0.5, 0, 0, 0], [0, 0.5, 0, 0], [0, 0, 0.5, 0], [1, 2, 3, 1]])
    vectors = vdb.Vec3SGrid()
    vectors.name = "vectors"
    vectors.fill((0, 0, 0), (3, 3, 3), (1.0, 2.0, 3.0))
    turned = vdb.FloatGrid(0)
    turned.name = "turned"
    turned.fill((0, 0, 0), (3, 3, 3), 1.0)
    turned.transform = vdb.createLinearTransform([[0, 1, 0, 0], [-1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    flat = vdb.FloatGrid(0)
    flat.name = "flat"
    flat.fill((0, 0, 0), (3, 3, 3), 1.0)
    flat.transform = vdb.createLinearTransform([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 2, 0], [0, 0, 0, 1]])
    vdb.write(str(HERE / "grids.vdb"), [ball, fog, vectors, turned, flat, vdb.FloatGrid(0)])


def image(kind):
    import numpy as np

    z, y, x = np.mgrid[:4, :5, :7]
    values = (x * 7 + y * 5 + z * 3) % 11
    return (values - 2 + 0.25 if kind.startswith("float") else values - 2 * (kind[0] == "i")).astype(kind)


def write_vti():
    import numpy as np
    import SimpleITK
    import vtk
    from vtk.util.numpy_support import numpy_to_vtk

    def write(name, kind, mode, zlib, header, base64=True, cells=False):
        of = vtk.vtkImageData()
        more = 1 if cells else 0
        of.SetExtent(2, 8 + more, -1, 3 + more, 0, 3 + more)
        of.SetOrigin(10, 20, 30)
        of.SetSpacing(0.5, 0.5, 0.5)
        to = of.GetCellData() if cells else of.GetPointData()
        array = numpy_to_vtk(np.ascontiguousarray(image(kind)).ravel(), deep=True)
        array.SetName("w")
        other = numpy_to_vtk(np.ascontiguousarray(image(kind)).ravel() + 1, deep=True)
        other.SetName("other")
        vectors = numpy_to_vtk(np.zeros((140, 3), kind), deep=True)
        vectors.SetName("vectors")
        [to.AddArray(a) for a in (vectors, other, array)]
        to.SetScalars(array)
        writer = vtk.vtkXMLImageDataWriter()
        writer.SetFileName(str(HERE / f"{name}.vti"))
        writer.SetInputData(of)
        {"ascii": writer.SetDataModeToAscii, "binary": writer.SetDataModeToBinary, "appended": writer.SetDataModeToAppended}[mode]()
        writer.SetEncodeAppendedData(base64)
        writer.SetCompressorTypeToZLib() if zlib else writer.SetCompressorTypeToNone()
        writer.SetBlockSize(64)
        writer.SetHeaderTypeToUInt64() if header == 64 else writer.SetHeaderTypeToUInt32()
        writer.Write()

    write("ascii", "float32", "ascii", False, 32)
    write("inline", "float64", "binary", False, 32)
    write("inline_zlib", "int64", "binary", True, 64)
    write("appended", "int16", "appended", False, 64, base64=False)
    write("appended_zlib", "float32", "appended", True, 32, base64=False)
    write("appended_base64", "uint8", "appended", False, 32)
    write("appended_base64_zlib", "uint32", "appended", True, 64)
    write("cells", "float32", "appended", True, 64, cells=True)
    for name in ("packed.mha", "packed.mhd"):
        packed = SimpleITK.GetImageFromArray(image("int16"))
        packed.SetSpacing((0.5, 0.5, 0.5))
        packed.SetOrigin((11, 19.5, 30))
        SimpleITK.WriteImage(packed, str(HERE / name), useCompression=True)


if __name__ == "__main__":
    {"vdb": write_vdb, "vti": write_vti}[sys.argv[1]]()
