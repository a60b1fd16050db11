"""Writes trimesh.glb as trimesh does: python3 -m venv v && v/bin/pip install trimesh==5.2.0 && v/bin/python make_trimesh_scene.py"""

from pathlib import Path

import trimesh

scene = trimesh.Scene()
ball = trimesh.creation.icosphere(subdivisions=2, radius=0.02)
ball.metadata["tissue"] = "liver"
stone = trimesh.creation.box(extents=(0.004, 0.006, 0.008))
stone.metadata.update(tissue="gallstone", priority=1)
# Mirrored and moved by the node, as programs place copies.
mirror = trimesh.transformations.reflection_matrix([0, 0, 0], [1, 0, 0])
scene.add_geometry(ball, node_name="organ")
scene.add_geometry(stone, node_name="stone", transform=trimesh.transformations.translation_matrix([0.005, 0, 0]))
scene.add_geometry(stone, node_name="mirrored", transform=mirror @ trimesh.transformations.translation_matrix([0.008, 0, 0]))
scene.export(Path(__file__).with_name("trimesh.glb"))
