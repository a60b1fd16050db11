"""Stations and programs that tests share."""

from __future__ import annotations

import json
import os
import subprocess
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import insonify
import numpy as np
import pytest
from insonify._program import program

Program = Callable[..., "subprocess.CompletedProcess[str]"]

SMALL: dict[str, Any] = {
    "width": 160,
    "height": 120,
    "scanlines": 48,
    "samples": 512,
    "depth_mm": 120,
}


@pytest.fixture(scope="session")
def run_program() -> Program:
    """The command line: that of INSONIFY_PROGRAM, else that of the package."""
    named = os.environ.get("INSONIFY_PROGRAM")
    file = Path(named) if named else program()
    if not file.is_file():
        pytest.fail(f"{file} is missing: build a wheel (scripts/wheel), or set INSONIFY_PROGRAM")

    def run(*arguments: object) -> subprocess.CompletedProcess[str]:
        return subprocess.run([str(file), *map(str, arguments)], capture_output=True, text=True, check=False)

    return run


@pytest.fixture
def small() -> insonify.Station:
    """A small picture of a sphere, in a few ms."""
    return insonify.Station("sphere", **SMALL)


def write_station(path: Path, tables: Mapping[str, Any]) -> Path:
    """Writes tables of numbers, texts and lists as a station file."""
    lines: list[str] = []
    for table, keys in tables.items():
        lines.append(f"[{table}]")
        lines += [f"{key} = {json.dumps(value)}" for key, value in keys.items()]
    path.write_text("\n".join(lines) + "\n")
    return path


def turned(pose: insonify.Pose, random: np.random.Generator, mm: float, degrees: float) -> insonify.Pose:
    """A pose near `pose`."""
    axis = random.normal(size=3)
    half = np.deg2rad(random.uniform(-degrees, degrees)) / 2
    quaternion = (np.cos(half), *(np.sin(half) * axis / np.linalg.norm(axis)))
    return pose @ insonify.Pose(random.uniform(-mm, mm, 3), quaternion)
