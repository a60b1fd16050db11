"""Effect plans."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, overload


@dataclass(frozen=True)
class Decision:
    """Decision about one effect."""

    effect: str
    """Name of the effect."""
    on: bool
    """Whether frames simulate it."""
    called_for: bool
    """Whether the scene calls for it."""
    choice: str
    """Choice in the station: auto, on or off."""
    reason: str
    """Reason, with the numbers that decided."""
    bound: Any
    """Largest error of a frame without the effect."""


class EffectPlan(Sequence[Decision]):
    """Effects that a scene calls for, and why. Its text is the table of `insonify plan --no-measure`."""

    def __init__(self, text: str, table: str) -> None:
        """Decisions as JSON, and their table."""
        self._decisions = [
            Decision(d["effect"], d["on"], d["called_for"], d["choice"], d["reason"], d.get("bound"))
            for d in json.loads(text)
        ]
        self._table = table

    @property
    def effects(self) -> list[str]:
        """Names of the effects that frames simulate."""
        return [decision.effect for decision in self._decisions if decision.on]

    @overload
    def __getitem__(self, index: int) -> Decision: ...
    @overload
    def __getitem__(self, index: slice) -> list[Decision]: ...
    def __getitem__(self, index: int | slice) -> Decision | list[Decision]:
        return self._decisions[index]

    def __len__(self) -> int:
        return len(self._decisions)

    def __iter__(self) -> Iterator[Decision]:
        return iter(self._decisions)

    def __str__(self) -> str:
        return self._table

    def __repr__(self) -> str:
        return f"<insonify.EffectPlan: {', '.join(self.effects)}>"
