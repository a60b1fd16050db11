"""Types: mypy and pyright at their strictest over package and examples, and stubs against the extension module."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
from pathlib import Path

import insonify
import pytest

PACKAGE = Path(insonify.__file__).parent
HERE = Path(__file__).parent.parent


def run(tool: str, *arguments: object) -> None:
    # Examples and extras import the packages of `scripts/test-python --all`.
    for needed in (tool.partition(".")[0], "ray", "stable_baselines3"):
        if importlib.util.find_spec(needed) is None:
            pytest.skip(f"{needed} is not installed")
    environment = dict(os.environ)
    # mypy finds installed packages by itself, and refuses site-packages in MYPYPATH.
    if PACKAGE.parent.name != "site-packages":
        environment["MYPYPATH"] = str(PACKAGE.parent)
    command = [sys.executable, "-m", tool, *map(str, arguments)]
    said = subprocess.run(command, capture_output=True, text=True, check=False, cwd=HERE, env=environment)
    assert said.returncode == 0, said.stdout + said.stderr


def test_mypy_finds_nothing() -> None:
    run("mypy", "--config-file", HERE / "pyproject.toml")


def test_pyright_finds_nothing() -> None:
    run("pyright", "--pythonpath", sys.executable)


def test_stubs_are_those_of_the_extension_module() -> None:
    allowed = HERE / "stubtest-allowed.txt"
    run("mypy.stubtest", "insonify", "--mypy-config-file", HERE / "pyproject.toml", "--allowlist", allowed)


def test_the_package_is_marked_as_typed() -> None:
    assert (PACKAGE / "py.typed").is_file() and (PACKAGE / "_insonify.pyi").is_file()


def test_all_that_is_exported_has_words() -> None:
    for name in insonify.__all__:
        found = getattr(insonify, name)
        assert isinstance(found, str) or found.__doc__, name
        for member, value in vars(found).items() if isinstance(found, type) else ():
            if not member.startswith("_") and callable(value):
                assert value.__doc__, f"{name}.{member}"
