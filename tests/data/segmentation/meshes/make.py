"""Writes the mesh files that the tests of the readers read: the same two spheres and a cube, by several tools."""

from pathlib import Path

import meshio
import numpy as np
import pyvista as pv
import trimesh
import vtk

OUT = Path(__file__).parent
ball = trimesh.creation.icosphere(subdivisions=1, radius=20)
ball.apply_translation([100, 0, 30])
box = trimesh.creation.box(extents=[10, 20, 30])
box.apply_translation([-100, 0, 30])


def trimesh_files():
    ball.export(OUT / "trimesh_binary.stl")
    ball.export(OUT / "trimesh_text.stl", file_type="stl_ascii")
    ball.export(OUT / "trimesh_binary.ply")
    ball.export(OUT / "trimesh_text.ply", encoding="ascii")
    scene = trimesh.Scene({"liver": ball, "spleen": box})
    scene.export(OUT / "trimesh_scene.glb")
    scene.export(OUT / "trimesh_scene.obj")


def meshio_files():
    points, cells = ball.vertices, [("triangle", ball.faces)]
    mesh = meshio.Mesh(points, cells)
    meshio.write(OUT / "meshio.obj", mesh)
    meshio.write(OUT / "meshio.ply", mesh)
    meshio.write(OUT / "meshio.stl", mesh, binary=True)


def vtk_poly(mesh):
    faces = np.hstack([np.full((len(mesh.faces), 1), 3), mesh.faces]).ravel()
    return pv.PolyData(np.asarray(mesh.vertices, dtype=np.float32), faces)


def space(poly, name="SPACE", value="LPS"):
    array = vtk.vtkStringArray()
    array.SetName(name)
    array.InsertNextValue(value)
    poly.GetFieldData().AddArray(array)
    return poly


def legacy(poly, name, binary, version, header="vtk output"):
    writer = vtk.vtkPolyDataWriter()
    writer.SetFileName(str(OUT / name))
    writer.SetInputData(poly)
    writer.SetFileVersion(version)
    writer.SetHeader(header)
    writer.SetFileTypeToBinary() if binary else writer.SetFileTypeToASCII()
    writer.Write()


def xml(poly, name, mode, compressed, appended_base64=True, big=False):
    writer = vtk.vtkXMLPolyDataWriter()
    writer.SetFileName(str(OUT / name))
    writer.SetInputData(poly)
    {
        "ascii": writer.SetDataModeToAscii,
        "binary": writer.SetDataModeToBinary,
        "appended": writer.SetDataModeToAppended,
    }[mode]()
    writer.SetEncodeAppendedData(appended_base64)
    writer.SetCompressorTypeToZLib() if compressed else writer.SetCompressorTypeToNone()
    if big:
        writer.SetByteOrderToBigEndian()
    writer.Write()


def strip(poly):
    stripper = vtk.vtkStripper()
    stripper.SetInputData(poly)
    stripper.Update()
    return stripper.GetOutput()


def vtk_files():
    poly = vtk_poly(ball)
    poly.point_data["scalars"] = np.arange(poly.n_points, dtype=np.float32)
    poly = poly.compute_normals(split_vertices=False)
    legacy(poly, "vtk_old_text.vtk", False, 42, "3D Slicer output. SPACE=RAS")
    legacy(poly, "vtk_old_binary.vtk", True, 42)
    legacy(space(vtk_poly(ball)), "vtk_new_text.vtk", False, 51, "3D Slicer output. SPACE=LPS")
    legacy(space(vtk_poly(ball)), "vtk_new_binary.vtk", True, 51)
    legacy(strip(vtk_poly(ball)), "vtk_strips.vtk", False, 51)
    xml(space(vtk_poly(ball)), "vtk_text.vtp", "ascii", False)
    xml(poly, "vtk_inline.vtp", "binary", False)
    xml(poly, "vtk_inline_zlib.vtp", "binary", True)
    xml(poly, "vtk_appended_base64.vtp", "appended", False, True)
    xml(poly, "vtk_appended_base64_zlib.vtp", "appended", True, True)
    xml(poly, "vtk_appended_raw.vtp", "appended", False, False)
    xml(poly, "vtk_appended_raw_zlib_big.vtp", "appended", True, False, True)
    xml(strip(vtk_poly(box)), "vtk_strips.vtp", "ascii", False)
    w = vtk.vtkSTLWriter()
    w.SetFileName(str(OUT / "slicer.stl"))
    w.SetInputData(poly)
    w.SetHeader("3D Slicer output. SPACE=LPS")
    w.SetFileTypeToBinary()
    w.Write()
    w = vtk.vtkPLYWriter()
    w.SetFileName(str(OUT / "slicer.ply"))
    w.SetInputData(poly)
    w.AddComment("3D Slicer output. SPACE=LPS")
    w.SetFileTypeToBinary()
    w.SetDataByteOrderToBigEndian()
    w.Write()
    append = vtk.vtkAppendFilter()
    append.AddInputData(vtk_poly(box))
    append.Update()
    w = vtk.vtkUnstructuredGridWriter()
    w.SetFileName(str(OUT / "grid.vtk"))
    w.SetInputData(append.GetOutput())
    w.Write()


def solid_but_binary():
    data = bytearray((OUT / "trimesh_binary.stl").read_bytes())
    data[:80] = b"solid exported by a tool that does not care".ljust(80)
    (OUT / "binary_solid.stl").write_bytes(bytes(data))


trimesh_files()
meshio_files()
vtk_files()
solid_but_binary()
