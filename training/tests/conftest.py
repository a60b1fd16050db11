"""Shared fixtures."""

import sys
from pathlib import Path

import pytest
import torch

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parents[1])]

import synthetic  # noqa: E402

from insonify_training.dataset import Dataset  # noqa: E402

torch.set_num_threads(1)


@pytest.fixture(scope="session")
def data_dir(tmp_path_factory):
    return synthetic.write(tmp_path_factory.mktemp("data") / "set")


@pytest.fixture(scope="session")
def data(data_dir):
    return Dataset(data_dir)
