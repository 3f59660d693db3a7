"""Files grouped into sessions: one transaction however many there are, and nothing read that cannot say anything."""

from __future__ import annotations

import random
from collections.abc import Iterator, Sequence
from contextlib import closing
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from eventsourcing.persistence import StoredEvent
from hypothesis import given, settings
from hypothesis import strategies as st

from ingest.bench.bench_file import Bench
from ingest.catalogue import quality
from ingest.catalogue.channels import ChannelData, load, load_each
from ingest.facts import facts
from ingest.facts.events import DecodeCompleted, Event, SessionRecorded, SessionRegrouped
from ingest.facts.facts import Facts, LookedUp
from ingest.facts.ledger import Ledger
from ingest.facts.sessions import Override, group, overrides_of, regroup
from ingest.facts.store import Store
from ingest.intake import grouping
from ingest.intake.intake import Intake, take_in
from ingest.intake.setup import MotorFile, prepare
from ingest.log import samples
from made.channels import channel
from made.events import decode, raw
from made.lines_of_damage import damage

BENCH = """\
schema = "whyhot.bench/1"
specimen_column = "specimen"
[time]
column = "time"
[[channel]]
signal = "R"
quantity = "insulation_resistance"
unit = "ohm"
"""
GIVEN = BENCH.replace("specimen_column", 'kind = "insulation_check"\nspecimen_column', 1)


def _no_motor(path: Path) -> MotorFile:
    raise AssertionError(f"{path} should not be read")


def take(folder: Path, specimens: Sequence[str], bench: str = GIVEN) -> Intake:
    """A table of checks, a row each ten seconds, of these specimens."""
    rows = [f"2026-01-01 {k // 360:02}:{k // 6 % 60:02}:{k % 6}0,{name},{1e9 + k}" for k, name in enumerate(specimens)]
    (folder / "checks.csv").write_text("\n".join(["time,specimen,R", *rows]) + "\n")
    (folder / "checks.toml").write_text(bench)
    paths = [folder / "checks.csv"]
    with Store.open(folder / "s", create=True) as store:
        return take_in(store, paths, prepare(paths, folder / "checks.toml", [], _no_motor), Override())


def now(folder: Path) -> Facts:
    with Store.open(folder / "s") as store:
        return facts.at(store.ledger)


@pytest.mark.parametrize("count", [2, 200])
def test_all_sessions_of_a_table_are_kept_in_one_transaction(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, count: int
) -> None:
    transactions: list[set[str]] = []
    insert = Ledger._insert

    def counted(ledger: Ledger, rows: Sequence[StoredEvent], after: int) -> Sequence[int] | None:
        transactions.append({row.topic.removeprefix("whyhot:") for row in rows})
        return insert(ledger, rows, after)

    monkeypatch.setattr(Ledger, "_insert", counted)
    take(tmp_path, [f"S{k}" for k in range(count)])
    assert len(now(tmp_path).sessions) == count
    assert [one for one in transactions if "SessionRecorded" in one] == [{"SessionRecorded"}]
    assert {"RawFileSealed", "DecodeCompleted"} in transactions  # of a file, together


def test_sessions_are_kept_all_or_none_and_the_same_command_finishes_what_was_stopped(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    specimens = ["S0", "S0", "S1", "S2", "S2"]

    def stopped(store: Store, known: Facts, some: Sequence[SessionRecorded]) -> Iterator[list[ChannelData]]:
        for session, channels in zip(some, load_each(store, known, some), strict=True):
            if session.specimen == "S2":
                raise KeyboardInterrupt
            yield channels

    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(grouping, "load_each", stopped)
        take(tmp_path, specimens, BENCH)
    assert (len(now(tmp_path).decodes), len(now(tmp_path).sessions)) == (1, 0)
    take(tmp_path, specimens, BENCH)
    assert [session.specimen for session in now(tmp_path).sessions] == ["S0", "S1", "S2"]
    assert [session.kind for session in now(tmp_path).sessions] == ["insulation_check"] * 3
    with Store.open(tmp_path / "s") as store:
        assert damage(store) == []


def test_a_session_whose_samples_cannot_be_read_stops_no_other_and_heals_at_a_later_ingest(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def stopped(*_: object) -> Iterator[list[ChannelData]]:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(grouping, "load_each", stopped)
        take(tmp_path, ["S0"] * 4, BENCH)
    (product,) = (tmp_path / "s" / "decoded").glob("*/*.parquet")
    whole = product.read_bytes()
    product.chmod(0o644)
    product.write_bytes(b"damaged")
    done = take(tmp_path, ["S1"] * 4, BENCH)
    assert [session.specimen for session in done.sessions] == ["S1"]
    (line,) = done.refusals
    assert line.startswith("session checks: is left for the next ingest: ")
    assert "whyhot rebuild" in line
    product.write_bytes(whole)
    assert take(tmp_path, ["S2"] * 4, BENCH).refusals == []
    assert {session.specimen for session in now(tmp_path).sessions} == {"S0", "S1", "S2"}


def test_samples_are_read_where_the_kind_is_to_be_told_or_a_finding_is_possible(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    read: list[str | None] = []

    def watched(store: Store, known: Facts, some: Sequence[SessionRecorded]) -> Iterator[list[ChannelData]]:
        read.extend(session.specimen for session in some)
        return load_each(store, known, some)

    monkeypatch.setattr(grouping, "load_each", watched)
    (tmp_path / "given").mkdir()
    take(tmp_path / "given", ["few"] * 3 + ["more"] * 4)
    assert read == ["more"]
    read.clear()
    (tmp_path / "open").mkdir()
    take(tmp_path / "open", ["few"] * 3 + ["more"] * 4, BENCH)
    assert read == ["few", "more"]


def test_sessions_of_one_table_read_it_once_and_hold_what_each_alone_holds(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    take(tmp_path, ["S0"] * 3 + ["S1"] + ["S2"] * 5)
    known = now(tmp_path)
    read: list[Path] = []
    whole = samples.read

    def counted(path: Path, columns: Sequence[str] | None = None, groups: Sequence[int] | None = None) -> pa.Table:
        read.append(path)
        return whole(path, columns, groups)

    with Store.open(tmp_path / "s") as store:
        alone = [load(store, known, session) for session in known.sessions]
        monkeypatch.setattr(samples, "read", counted)
        together = list(load_each(store, known, known.sessions))
    assert len(read) == 1
    assert [len(channels[0].value) for channels in together] == [3, 1, 5]
    for (one,), (other,) in zip(together, alone, strict=True):
        assert (one.spec, one.raws, one.buses) == (other.spec, other.raws, other.buses)
        for name in ("t_ns", "value", "record", "raw"):
            np.testing.assert_array_equal(getattr(one, name), getattr(other, name))


def test_a_gap_among_four_records_is_still_said(tmp_path: Path) -> None:
    (tmp_path / "checks.toml").write_text(GIVEN)
    stamps = ("08:00:00", "08:00:10", "08:00:20", "09:00:00")
    rows = [f"2026-01-01 {stamp},S0,1e9" for stamp in stamps]
    (tmp_path / "checks.csv").write_text("\n".join(["time,specimen,R", *rows]) + "\n")
    paths = [tmp_path / "checks.csv"]
    with Store.open(tmp_path / "s", create=True) as store:
        intake = take_in(store, paths, prepare(paths, tmp_path / "checks.toml", [], _no_motor), Override())
    assert [flag.flag for _, flag in intake.flags] == ["gap"]


SAMPLES = st.lists(st.tuples(st.floats(0, 1e6), st.integers(-2, 2)), min_size=1, max_size=grouping.FEW_RECORDS)


@settings(max_examples=100, deadline=None)
@given(SAMPLES, SAMPLES)
def test_so_few_records_hold_no_finding(one: list[tuple[float, int]], other: list[tuple[float, int]]) -> None:
    channels = [
        channel(
            name, "temperature", [float(value) for _, value in some], t_s=np.sort([t_s for t_s, _ in some]), node="x"
        )
        for name, some in (("a", one), ("b", other))
    ]
    assert quality.findings(quality.assess(channels)) == []


SECOND = 1_000_000_000
BENCHES = {sha: Bench(sha256=sha, name=f"{sha}.toml", join_gap_s=gap_s) for sha, gap_s in (("b1", 10.0), ("b2", 30.0))}


def arrival(chance: random.Random, k: int) -> tuple[list[tuple[str, Event]], dict[str, Override]]:
    """A log, or an earlier one once more under another bench file; with a specimen said or none."""
    number = chance.choice([k, chance.randrange(k + 1)])
    log = raw(f"{number}.csv")
    begun = random.Random(number).randrange(150) * SECOND
    bench = chance.choice([None, "b1", "b2"])
    outcome = "quarantined" if random.Random(number).random() < 0.1 else "decoded"
    absolute = random.Random(number).random() < 0.8
    times = {"start_ns": begun, "end_ns": begun + 5 * SECOND, "absolute": absolute, "outcome": outcome}
    events: list[tuple[str, Event]] = [(f"file-{log.sha256}", log)]
    events.append((f"file-{log.sha256}", decode(f"{number}{bench}", log.sha256, bench, **times)))
    said = Override(specimen=chance.choice(["S1", "S2"])) if chance.random() < 0.5 else None
    return events, {log.sha256: said} if said else {}


@pytest.mark.parametrize("seed", range(6))
def test_sessions_near_to_new_logs_are_put_together_as_if_all_were(tmp_path: Path, seed: int) -> None:
    chance = random.Random(seed)
    with closing(Ledger(tmp_path, write=True, create=True)) as ledger:
        for k in range(40):
            events, said = arrival(chance, k)
            ledger.append_all(events)
            if chance.random() < 0.1:  # stopped before it was grouped: the next takes it up
                continue
            known, recorded = facts.at(ledger), ledger.events()
            raws = {event.raw for _, event in events if isinstance(event, DecodeCompleted)}
            assert isinstance(known, LookedUp)
            changes = grouping._changes_near(known, raws, BENCHES, said)
            whole = facts.fold(recorded)
            every = [one.event for one in recorded if isinstance(one.event, SessionRecorded)]
            overrides = {**overrides_of(every, BENCHES, whole.decodes), **said}
            names = {sha: one.name for sha, one in whole.files.items()}
            expected = regroup(whole.sessions, group(list(whole.decodes.values()), BENCHES, names, overrides))
            assert sorted(changes, key=str) == sorted(expected, key=str)
            ledger.append_all([(f"session-{one.session}", one) for one in changes])
        assert len(ledger.events(SessionRegrouped)) > 5
