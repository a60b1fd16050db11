"""The command `insonify` of the package."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import insonify
import pytest
from insonify._program import program

pytestmark = pytest.mark.skipif(not program().is_file(), reason="this installation has no program: scripts/wheel")

COMMAND = [sys.executable, "-m", "insonify"]


def run(*arguments: object) -> subprocess.CompletedProcess[str]:
    environment = {name: value for name, value in os.environ.items() if name != "ORT_DYLIB_PATH"}
    command = [*COMMAND, *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False, env=environment, timeout=120)


def test_arguments_output_and_exit_code_pass_through(tmp_path: Path) -> None:
    assert run("--version").stdout.split() == ["insonify", insonify.__version__]
    wrong = run("render", tmp_path / "nothing.toml")
    assert wrong.returncode == 2 and "nothing.toml" in wrong.stderr
    station = insonify.data_directory() / "configs" / "sphere.toml"
    made = run("render", station, "--quality", "fast", "--out", tmp_path / "out")
    assert made.returncode == 0 and (tmp_path / "out" / "bmode.png").is_file()


def test_it_finds_onnx_runtime_of_the_environment(tmp_path: Path) -> None:
    pytest.importorskip("onnxruntime", minversion="1.24")
    model = insonify.data_directory() / "assets" / "generators" / "demo_smooth" / "demo_smooth.onnx"
    said = run("-v", "generator", model, "--runs", 1)
    assert said.returncode == 0, said.stderr


@pytest.mark.skipif(os.name == "nt", reason="signals of Unix")
def test_ctrl_c_reaches_it(tmp_path: Path) -> None:
    station = insonify.data_directory() / "configs" / "sphere.toml"
    command = [*COMMAND, "dataset", str(station), "--frames", "500", "--out", str(tmp_path / "data")]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        deadline = time.monotonic() + 60
        while not list((tmp_path / "data").glob("tuples/*.npy")) and time.monotonic() < deadline:
            time.sleep(0.1)
        process.send_signal(signal.SIGINT)
        assert process.wait(20) != 0
