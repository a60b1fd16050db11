"""Reads a tracked sequence with SimpleITK (PyPI: SimpleITK and numpy) and prints its content as JSON.

Usage: python3 read_sequence.py SEQUENCE.igs.mha
"""

import hashlib
import json
import sys

import SimpleITK


def main(path):
    reader = SimpleITK.ImageFileReader()
    reader.SetFileName(path)
    image = reader.Execute()
    fields = {key: image.GetMetaData(key) for key in image.GetMetaDataKeys()}
    pixels = SimpleITK.GetArrayFromImage(image)
    seen = {
        "size": image.GetSize(),
        "type": image.GetPixelIDTypeAsString(),
        "sha256": hashlib.sha256(pixels.tobytes()).hexdigest(),
        "fields": fields,
    }
    json.dump(seen, sys.stdout)


if __name__ == "__main__":
    main(sys.argv[1])
