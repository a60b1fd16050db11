"""Settings by keyword, and what station files say."""

from __future__ import annotations

import difflib
import json
import os
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any, NamedTuple, cast

import numpy as np

from . import _insonify
from ._errors import StationError
from ._pose import Pose


class Key(NamedTuple):
    """A key of station files."""

    table: str
    """Table; `tissues.NAME` for any tissue."""
    key: str
    """Key without its table."""
    unit: str
    """Unit, or empty."""
    default: str
    """Default as TOML, or in words."""
    accepts: str
    """Accepted values."""
    meaning: str
    """Meaning, as a phrase."""


@cache
def station_keys() -> tuple[Key, ...]:
    """Every key of station files, as `insonify station-keys` lists them."""
    return tuple(Key(*row) for row in _insonify.station_keys())


@cache
def _tables() -> dict[str, list[str]]:
    """Tables that have a key, for each key that is neither a tissue's nor an effect."""
    tables: dict[str, list[str]] = {}
    for key in station_keys():
        if key.table != "effects" and not key.table.startswith("tissues."):
            tables.setdefault(key.key, []).append(key.table)
    return tables


def nested(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Keywords by their tables: `gain_db=30` becomes `{"image": {"gain_db": 30}}`."""
    known = _tables()
    names = {key.table.split(".")[0] for key in station_keys()}
    found: dict[str, Any] = {}
    for name, given in settings.items():
        value = plain(given)
        table, _, key = name.partition(".")
        if key:
            found.setdefault(table, {})[key] = value
        elif name in names and (value is None or isinstance(value, dict)):
            if value is None:
                found[name] = None
            else:
                found.setdefault(name, {}).update(value)
        elif len(known.get(name, ())) == 1:
            found.setdefault(known[name][0], {})[name] = value
        elif name in known:
            ways = " or ".join(f"{table}={{'{name}': ...}}" for table in known[name])
            raise StationError(f"`{name}` is a key of several tables: give {ways}")
        else:
            close = difflib.get_close_matches(name, [*known, *names], 1)
            hint = f"; did you mean `{close[0]}`?" if close else ""
            raise StationError(f"no key of station files is called `{name}`{hint}: insonify.station_keys() lists them")
    return found


def plain(value: Any) -> Any:
    """A value as one of TOML: arrays become lists, paths texts, and poses their table."""
    if isinstance(value, Pose):
        return {"position_mm": list(value.position_mm), "quaternion": list(value.quaternion_wxyz)}
    if isinstance(value, Mapping):
        return {key: plain(inner) for key, inner in value.items()}
    if isinstance(value, (list, tuple)):
        sequence = cast("Sequence[Any]", value)
        return [plain(inner) for inner in sequence]
    if isinstance(value, (np.ndarray, np.generic)):
        return cast("np.generic", value).tolist()
    if isinstance(value, os.PathLike):
        return os.fspath(cast("os.PathLike[str]", value))
    return value


def tissues() -> dict[str, dict[str, Any]]:
    """Built-in tissues with their properties, published ranges and sources."""
    table: dict[str, dict[str, Any]] = json.loads(_insonify.builtin_tissues_json())
    return table
