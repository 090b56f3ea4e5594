"""The outcome of one comparison: raw numbers, what they mean, and what they are to be held against."""

from dataclasses import asdict, dataclass, field
from typing import Any


@dataclass
class Evaluation:
    """Numbers of one prediction under one protocol.

    Attributes:
        protocol: Name of the protocol.
        values: Metric -> raw number, in the units of `definitions`.
        blanks: Metric -> why there is no number.
        floors: Floor -> metric -> raw number: what a perfect or an idle method gets from the same samples.
        floor_blanks: Floor -> why it does not exist.
        definitions: Metric -> formula, unit, factor of the printed number, frame, thresholds.
        samples: Which points were compared: side -> count and origin.
        notes: What the reader should know besides.
    """

    protocol: str
    values: dict[str, float] = field(default_factory=dict)
    blanks: dict[str, str] = field(default_factory=dict)
    floors: dict[str, dict[str, float]] = field(default_factory=dict)
    floor_blanks: dict[str, str] = field(default_factory=dict)
    definitions: dict[str, dict[str, Any]] = field(default_factory=dict)
    samples: dict[str, dict[str, Any]] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)

    def printed(self, metric: str, value: float | None = None) -> float:
        """Return a number in the unit of the published tables, by default this evaluation's own."""
        raw = self.values[metric] if value is None else value
        return raw * self.definitions[metric]["factor"]

    def as_json(self) -> dict[str, Any]:
        """Return everything as plain numbers, texts and dicts."""
        return asdict(self)
