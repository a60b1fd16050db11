"""The command `insonify`, a program that the package carries."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from ._data import data_directory
from ._generator import use_onnxruntime


def program() -> Path:
    """The program that the package carries."""
    return data_directory() / "bin" / ("insonify.exe" if os.name == "nt" else "insonify")


def main() -> int:
    """Runs the program with this process's arguments, and ONNX Runtime of the package `onnxruntime` if it is installed."""
    file = program()
    if not file.is_file():
        print(f"error: this installation has no program ({file}): install a wheel", file=sys.stderr)
        return 1
    use_onnxruntime()
    arguments = [str(file), *sys.argv[1:]]
    if os.name == "nt":
        return subprocess.run(arguments, check=False).returncode
    if not os.access(file, os.X_OK):
        file.chmod(0o755)
    os.execv(file, arguments)
