"""Examples in words: docstrings, the documents' Python, and the scripts of `examples`."""

from __future__ import annotations

import doctest
import importlib
import os
import pkgutil
import re
import subprocess
import sys
from pathlib import Path

import insonify
import pytest

HERE = Path(__file__).parent.parent
ROOT = HERE.parent
DOCUMENTS = [HERE / "README.md", ROOT / "README.md", ROOT / "docs" / "python.md"]


def modules() -> list[str]:
    found = pkgutil.walk_packages(insonify.__path__, "insonify.")
    return [
        "insonify",
        *(module.name for module in found if "_insonify" not in module.name and "__main__" not in module.name),
    ]


@pytest.mark.parametrize("name", modules())
def test_examples_of_docstrings_hold(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    try:
        module = importlib.import_module(name)
    except ModuleNotFoundError as error:
        pytest.skip(str(error))
    assert doctest.testmod(module).failed == 0


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: f"{path.parent.name}/{path.name}")
def test_the_python_of_documents_runs(document: Path, tmp_path: Path) -> None:
    """All blocks of a document run one after another, in one process."""
    if not document.is_file():
        pytest.fail(f"{document} is missing")
    blocks = re.findall(r"```python\n(.*?)```", document.read_text(), re.DOTALL)
    assert blocks
    needed = re.findall(r"^(?:import|from) (\w+)", "\n".join(blocks), re.MULTILINE)
    for package in needed:
        pytest.importorskip(package)
    script = tmp_path / "document.py"
    # Processes that are spawned import the script again.
    script.write_text(
        "if __name__ == '__main__':\n" + "".join(f"    {line}\n" for line in "\n".join(blocks).splitlines())
    )
    said = subprocess.run([sys.executable, script], capture_output=True, text=True, check=False, cwd=tmp_path)
    assert said.returncode == 0, said.stderr


@pytest.mark.parametrize("example", ["first_frame.py", "many_frames.py"])
def test_examples_run(example: str, tmp_path: Path) -> None:
    command = [sys.executable, HERE / "examples" / example]
    said = subprocess.run(command, capture_output=True, text=True, check=False, cwd=tmp_path)
    assert said.returncode == 0 and said.stdout, said.stderr


def test_a_sweep_measures_the_cyst() -> None:
    sys.path.insert(0, str(HERE / "examples"))
    pytest.importorskip("gymnasium")
    many_frames = importlib.import_module("many_frames")
    # A ball of 10 mm has 4.19 ml; its surface here is of flat faces.
    assert 3.9 < many_frames.main(60) < 4.2


def test_a_few_steps_of_training_run() -> None:
    pytest.importorskip("stable_baselines3")
    sys.path.insert(0, str(HERE / "examples"))
    os.environ.setdefault("CUDA_VISIBLE_DEVICES", "")
    train_reach = importlib.import_module("train_reach")
    agent = train_reach.train(minutes=1, steps=512)
    assert agent.num_timesteps >= 512
    share, _ = train_reach.judged(agent, 2)
    assert 0 <= share <= 1
