"""The facts behind an answer as events of OpenLineage, which catalogues of data take in: https://openlineage.io.

A run is what made something: a log decoded, sessions replayed or diagnosed. Datasets are files and answers under their
names, each in the version that its SHA-256 or id says. An event is one that a run ended well: when it began is no fact.
"""

from __future__ import annotations

import uuid
from collections.abc import Iterable, Sequence
from typing import Any

from ingest.facts.facts import Facts
from ingest.facts.lineage import FactLink
from whyhot import __version__

Json = dict[str, Any]

SPEC = "https://openlineage.io/spec"
NAMESPACE = "whyhot"
PRODUCER = f"urn:whyhot:{__version__}"
ANSWERS = ("replay", "diagnosis", "calibration", "ageing", "session", "motor file", "inspection")


def events(facts: Facts, links: Sequence[FactLink]) -> list[Json]:
    """A RunEvent for each decoded log among `links`, which lead from an answer down to the bytes; and one for that."""
    found = [_decoded(facts, one) for one in links if one.kind == "decode"]
    if links[0].kind in ANSWERS:
        found.append(_answered(facts, links[0], links[1:]))
    return [one for one in found if one["eventTime"]]


def _decoded(facts: Facts, link: FactLink) -> Json:
    decode = facts.decodes[link.id]
    log = facts.files[decode.raw]
    read_with = [_dataset("signal database", facts.databases[one].name, one) for one in decode.databases]
    if decode.bench:
        read_with.append(_dataset("bench file", facts.benches[decode.bench].name, decode.bench))
    return _run(link, [_dataset("log", log.name, log.sha256), *read_with], _samples(facts, link))


def _answered(facts: Facts, answer: FactLink, links: Iterable[FactLink]) -> Json:
    """What the answer was made of: the samples, the bench files, and of a motor file and its forerunners the first."""
    models = [one for one in links if one.kind == "motor file"][:1]
    inputs = [_dataset(one.kind, facts.models[one.id].file, one.id) for one in models]
    inputs += [_dataset(one.kind, facts.benches[one.id].name, one.id) for one in links if one.kind == "bench file"]
    inputs += [_samples(facts, one) for one in links if one.kind == "decode"]
    name = facts.models[answer.id].file if answer.kind == "motor file" else answer.id
    return _run(answer, inputs, _dataset(answer.kind, name, answer.id))


def _samples(facts: Facts, link: FactLink) -> Json:
    return _dataset("samples", facts.files[facts.decodes[link.id].raw].name, link.id)


def _run(link: FactLink, inputs: Sequence[Json], output: Json) -> Json:
    said: Json = {"documentation": _facet("1-1-0", "DocumentationJobFacet", description=link.says)}
    if link.command:
        said["sourceCode"] = _facet("1-0-1", "SourceCodeJobFacet", language="shell", sourceCode=link.command)
    version = str(link.code).removeprefix("whyhot ")
    engine = _facet("1-1-1", "ProcessingEngineRunFacet", name=NAMESPACE, version=version)
    return {
        "eventType": "COMPLETE",
        "eventTime": link.recorded,
        "producer": PRODUCER,
        "schemaURL": f"{SPEC}/2-0-2/OpenLineage.json#/$defs/RunEvent",
        "run": {
            "runId": str(uuid.uuid5(uuid.NAMESPACE_OID, f"{link.kind} {link.id}")),
            "facets": {"processing_engine": engine},
        },
        "job": {"namespace": NAMESPACE, "name": link.kind, "facets": said},
        "inputs": list(inputs),
        "outputs": [output],
    }


def _dataset(kind: str, name: str, version: str) -> Json:
    facet = _facet("1-0-1", "DatasetVersionDatasetFacet", datasetVersion=version)
    return {"namespace": NAMESPACE, "name": f"{kind}/{name}", "facets": {"version": facet}}


def _facet(version: str, of: str, /, **said: str) -> Json:
    return {"_producer": PRODUCER, "_schemaURL": f"{SPEC}/facets/{version}/{of}.json#/$defs/{of}", **said}
