"""Data sets by Ray Data; needs the extra `insonify[ray]`.

Each worker renders parts of the plan into a directory that all of them see, and hands their tuples on. A run that was stopped goes on
where it was. Tuples are those of `insonify dataset` on the same device, bit for bit.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import ray.data

from ._data import StrPath, station_file
from ._dataset import Dataset, make_dataset


class _Renderer:
    """Renders parts of a plan, in a worker."""

    def __init__(self, stations: list[str], directory: str, options: dict[str, Any]) -> None:
        self._stations, self._directory, self._options = stations, directory, options

    def __call__(self, part: dict[str, Any]) -> list[dict[str, Any]]:
        made = make_dataset(self._stations, self._directory, shard=part["shard"], **self._options)
        data = Dataset(self._directory)
        rows: list[dict[str, Any]] = []
        for place in range(len(data)):
            row = data.row(place)
            if row["index"] in made.indices:
                pose = [*row["pose"]["position_mm"], *row["pose"]["quaternion"]]
                rows.append({"index": row["index"], "split": row["split"], "pose": pose, **data.tuple(place)})
        return rows


def dataset(
    stations: StrPath | Sequence[StrPath],
    directory: StrPath,
    *,
    parts: int,
    workers: int = 2,
    cpus: int = 1,
    **options: Any,
) -> ray.data.Dataset:
    """Tuples of a data set as rows of Ray Data: index, split, pose, and the arrays of `insonify.Tuple`.

    The plan is cut into `parts`, which `workers` render with `cpus` threads each. `options` are those of `make_dataset`.
    """
    several = [stations] if isinstance(stations, str) or not isinstance(stations, Sequence) else stations
    files = [str(station_file(station).resolve()) for station in several]
    shards = ray.data.from_items(
        [{"shard": f"{number}/{parts}"} for number in range(1, parts + 1)], override_num_blocks=parts
    )
    return shards.flat_map(
        _Renderer,
        fn_constructor_args=(files, str(Path(directory).resolve()), options),
        concurrency=workers,
        num_cpus=cpus,
        runtime_env={"env_vars": {"RAYON_NUM_THREADS": str(cpus)}},
    )
