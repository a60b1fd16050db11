"""Receives one image and one transform from insonify's OpenIGTLink server by pyigtl, and prints their content.

Usage: openigtlink_receive.py PORT
"""

import json
import sys

import numpy
import pyigtl

client = pyigtl.OpenIGTLinkClient("127.0.0.1", int(sys.argv[1]))
image = client.wait_for_message("Image", timeout=15)
transform = client.wait_for_message("ProbeToScene", timeout=15)
if image is None or transform is None:
    sys.exit("no image or no transform within 15 s")
depth, height, width = image.image.shape


def to_world(i, j):
    return (image.ijk_to_world_matrix @ [i, j, 0, 1])[:3].tolist()


print(
    json.dumps(
        {
            "shape": image.image.shape,
            "world": image.world_coordinate_system,
            "pixels": image.image.flatten().tolist(),
            "first_pixel": to_world(0, 0),
            "last_pixel": to_world(width - 1, height - 1),
            "probe_point": (numpy.asarray(transform.matrix) @ [1, 2, 3, 1])[:3].tolist(),
        }
    ),
    flush=True,
)
client.stop()
