"""What `whyhot sessions` and `whyhot show` answer: the catalogue of the store, and one session looked through."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

from ingest.catalogue import operating_points, power, quality
from ingest.catalogue.channels import ChannelData
from ingest.catalogue.contradicting import contradicting
from ingest.catalogue.decoded import DecodedFile, files_of, taken_off
from ingest.catalogue.description import ChannelDescription, Repeats, SessionDescription, SourceDescription
from ingest.catalogue.kinds import NO_DRIVE
from ingest.catalogue.looked import Looked, look
from ingest.catalogue.quality import ChannelQuality
from ingest.facts.events import COUNTS, SAME_NAME, DecodeCompleted, SessionRecorded
from ingest.facts.facts import Facts
from ingest.facts.standing import records
from ingest.log.findings import findings
from ingest.texts.names import first_of

if TYPE_CHECKING:
    from ingest.facts.store import Store


def describe(store: Store, facts: Facts, session: SessionRecorded) -> SessionDescription:
    """Look through the samples of a session. Raises DamageError where they are damaged or missing."""
    found = described(facts, session, look(store, facts, session))
    files = files_of(store, facts, session)
    missing = [] if session.kind in NO_DRIVE else _not_there(files)  # those have logs of their own, with few sensors
    return replace(found, findings=(*found.findings, *missing), corrections=tuple(taken_off(files)))


def _not_there(files: Sequence[DecodedFile]) -> list[str]:
    """The thermometers of a session's bench file that none of its logs holds, where nothing else measures their
    place."""
    places = {place for one in files for s in one.sources for place in (s.spec.node, *s.spec.weights)}
    stated = [channel for one in files if one.bench for channel in one.bench.channels]
    missing = {
        f"{one.name} ({one.node})": None
        for one in stated
        if one.quantity == "temperature" and one.role != "ignored" and one.needs and one.node not in {None, *places}
    }
    return [f"{first_of(list(missing), 3)}: in the bench file, and in none of its logs"] if missing else []


def described(facts: Facts, session: SessionRecorded, samples: Looked) -> SessionDescription:
    """What there is to say of a session that was looked through."""
    channels, qualities = samples.channels, samples.qualities
    balance = power.balance(channels)
    bench = facts.bench_of(session)
    decodes = [facts.decodes[file["decode"]] for file in session.files]
    flagged = [says for decode in decodes for says in _flagged(facts, decode)]
    found = [flag.says for flag in contradicting(channels, lambda raw: facts.files[raw].name)]
    there = {one.spec.name for one in channels if len(one.t_ns)}
    found += [quality.without_value(name) for name in known_channels(facts, session) if name not in there]
    found += [flag.says for flag in quality.findings(qualities)]
    seen = [f"{one.name}: {one.finding}" for one in facts.inspections.values() if one.session == session.session]
    late = [one.says for one in facts.clocks_of(session)]
    impossible = [balance.says] if balance and not balance.possible else []
    currents = filter(None, [power.two_currents(channels)])
    return SessionDescription(
        session=session.session,
        name=session.name,
        kind=session.kind,
        kind_why=session.kind_why,
        start=iso(session.start_ns) if session.absolute else None,
        duration_s=_duration_s(session),
        specimen=session.specimen,
        batch=session.batch,
        motor=bench.motor if bench else None,
        bench=bench.name if bench else None,
        configuration=session.configuration,
        attributes=session.attributes,
        changes=tuple(dict.fromkeys(one for decode in decodes for one in decode.settings.get("changes", ()))),
        sources=tuple(_source(facts, file) for file in session.files),
        channels=tuple(_channel(*pair) for pair in zip(channels, qualities, strict=True)),
        power=balance,
        operating_points=operating_points.cells(channels),
        findings=tuple(dict.fromkeys([*flagged, *found, *late, *impossible, *currents, *seen])),
    )


def _flagged(facts: Facts, decode: DecodeCompleted) -> list[str]:
    """What is to be looked at in a log, as it is decoded now: what an earlier decode said may be mended since."""
    said = (flag.says for flag in facts.flags.get(f"file-{decode.raw}", ()) if flag.flag == SAME_NAME)
    return [*(flag.says for flag in findings(facts.files[decode.raw].name, decode)), *said]


def sessions_json(facts: Facts, sessions: Sequence[SessionRecorded] | None = None) -> dict[str, Any]:
    """The answer of `sessions --json` (schema `whyhot.sessions/1`), of these sessions (None: of all).

    `quarantined` counts the records of a session's files that were kept but not decoded: rejected, or shorter than
    their message. `quarantined_files` are those in which nothing could be read; they belong to no session.
    """
    unread = [{"file": facts.files[raw].name, "sha256": raw, "why": why} for raw, why in facts.unread().items()]
    shown = [_summary(facts, session) for session in (facts.sessions if sessions is None else sessions)]
    return {"schema": "whyhot.sessions/1", "sessions": shown, "quarantined_files": unread}


def iso(t_ns: int) -> str:
    """ISO 8601 UTC of nanoseconds since 1970, with milliseconds where they are not zero."""
    whole, rest = divmod(t_ns, 1_000_000_000)
    text = datetime.fromtimestamp(whole, UTC).strftime("%Y-%m-%dT%H:%M:%S")
    return f"{text}.{rest // 1_000_000:03d}Z" if rest >= 1_000_000 else f"{text}Z"


def _duration_s(session: SessionRecorded) -> float:
    return (session.end_ns - session.start_ns) / 1e9


def _summary(facts: Facts, session: SessionRecorded) -> dict[str, Any]:
    bench = facts.bench_of(session)
    raws = list(dict.fromkeys(file["raw"] for file in session.files))
    decodes = [facts.decodes[decode] for decode in dict.fromkeys(file["decode"] for file in session.files)]
    return {
        "session": session.session,
        "name": session.name,
        "start": iso(session.start_ns) if session.absolute else None,
        "duration_s": _duration_s(session),
        "kind": session.kind,
        "motor": bench.motor if bench else None,
        "specimen": session.specimen,
        "batch": session.batch,
        "sources": [facts.files[raw].name for raw in raws],
        "channels": len(known_channels(facts, session)),
        "quarantined": sum(one.balance.get(key, 0) for one in decodes for key in ("rejected", "wrong_length")),
    }


def known_channels(facts: Facts, session: SessionRecorded) -> list[str]:
    """The channels that a session's logs know of, with or without values, but for those that are ignored."""
    decodes = [facts.decodes[file["decode"]] for file in session.files]
    return list(dict.fromkeys(one["name"] for decode in decodes for one in decode.channels if one["role"] != "ignored"))


def _source(facts: Facts, file: Mapping[str, Any]) -> SourceDescription:
    decode = facts.decodes[file["decode"]]
    return SourceDescription(
        file=facts.files[decode.raw].name,
        sha256=decode.raw,
        decode=decode.decode,
        outcome=decode.outcome,
        why=decode.why,
        first_record=file["first_record"],
        last_record=file["last_record"],
        records=records(file),
        balance=decode.balance,
        unknown_ids=decode.unknown_ids,
        rejections=decode.rejections,
        holds=decode.balance.get("found", 0) == sum(decode.balance.get(key, 0) for key in COUNTS),
        times=next(iter(decode.settings.get("times", ())), None),
    )


def _channel(data: ChannelData, seen: ChannelQuality) -> ChannelDescription:
    spans: Sequence[tuple[str, float]] = [
        *(("gap", gap.duration_s) for gap in seen.gaps),
        *((stretch.kind, stretch.duration_s) for stretch in seen.stretches),
    ]
    kinds = {kind: [length for name, length in spans if name == kind] for kind, _ in spans}
    return ChannelDescription(
        name=data.spec.name,
        quantity=data.spec.quantity or None,
        unit=data.unit,
        node=data.place,
        role=data.spec.role,
        samples=seen.samples,
        rate_Hz=seen.rate_Hz,
        low=seen.low,
        high=seen.high,
        noise=seen.noise,
        resolution=seen.resolution,
        repeats=tuple(Repeats(kind, len(some), max(some), sum(some)) for kind, some in kinds.items()),
    )
