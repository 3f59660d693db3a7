"""New versions with a parent: the motor file and the bench file that say what a diagnosis found."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ingest.facts import Facts
from ingest.store import Store
from replay.engine.bench_text import corrected
from replay.engine.motor_text import written
from twin.features import Monomial
from twin.fit import Fit
from twin.learned import network_of
from twin.network import Network


def sealed_motor(store: Store, facts: Facts, parent: str, found: Fit, monomials: Sequence[Monomial], note: str) -> str:
    """The motor file `parent` with what a fit learnt, sealed; its id."""
    network: Network = network_of(found, monomials)
    return store.archive.seal(written(store.archive.read(parent), facts.models[parent].file, network, note))


def sealed_bench(store: Store, parent: str, name: str, amounts: Mapping[str, float], note: str) -> str:
    """The bench file `parent` with what channels, clocks, inputs and boundaries are off by (cause id -> amount), sealed."""
    return store.archive.seal(corrected(store.archive.read(parent), name, amounts, note))
