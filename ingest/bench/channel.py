"""One channel of a bench file, as it is written there."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from ingest.texts.expressions import parse


@dataclass(frozen=True)
class Channel:
    """One `[[channel]]` or `[[derived]]`. Numbers are in the *stored* unit of the quantity (quantities.STORED_UNIT).

    Exactly one of `signal` (a name in the log), `expression` (with `name`) and `value` (of a boundary that no log
    holds) is given. `node` is a node or a
    boundary of the motor file; `weights` a weighted mean of nodes.
    """

    name: str  # the signal's bare name, or the derived channel's
    quantity: str  # "" where an ignored channel says none
    unit: str  # in the file
    signal: str | None = None
    expression: str | None = None
    value: float | None = None
    node: str | None = None
    weights: Mapping[str, float] = field(default_factory=dict)
    region: str | None = None
    level: str = "testing"
    noise: float | None = None
    bias_sd: float | None = None
    resolution: float | None = None
    time_constant_s: float = 0.0
    sensor: str | None = None
    card: str | None = None
    convention: str = "rms"
    role: str | None = None  # observed | input | ignored; None = by rule
    gain_sd: float | None = None  # of the share by which an observed power, heat, resistance or flux reads too much
    reference: float | None = None  # of an observed resistance or flux: what it reads at reference_degC
    reference_degC: float = 20.0
    slope_per_K: float | None = None  # of the reading over the reference
    bin_degC: tuple[float, float] | None = None  # of a dose: between which temperatures a counter counts its hours
    was: str | None = None  # the signal that it had first, where a change renamed it
    renamed: Mapping[str, str] = field(default_factory=dict)  # signals of the expression -> what they are called now
    line: int = 0  # of the bench file, for messages
    lines: Mapping[str, int] = field(default_factory=dict, compare=False, repr=False)  # of its keys

    def at(self, key: str) -> int:
        """Line of `key`, of the whole entry where it is not written."""
        return self.lines.get(key, self.line)

    @property
    def needs(self) -> tuple[str, ...]:
        """The signals that it is made of, as the log calls them; of an expression in the order of its names."""
        if self.value is not None:
            return ()
        names = parse(self.expression).names if self.expression else (str(self.signal),)
        return tuple(self.renamed.get(name, name) for name in names)

    @property
    def called(self) -> str:
        """How a message calls it: `signal "X"`, or `derived channel "X"`."""
        if self.value is not None:
            return f'the value of "{self.node}"'
        return f'derived channel "{self.name}"' if self.expression else f'signal "{self.signal}"'
