"""The report and the terminal's text: what they say, and that nothing leaves the page."""

from __future__ import annotations

import re
from base64 import b64encode
from dataclasses import replace
from hashlib import sha256
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from ingest.texts.times import clock
from made.runs import made_run
from replay.engine.results.run import Run
from replay.engine.results.summary import LimitPassed, ModelledSpot
from replay.show.reports.report import LINES, ReportContext, mixed, write_report
from replay.show.words import words
from replay.show.words.findings import answer, finding, power_balance, worst_first
from replay.show.words.terminal import labelled, replay_text
from replay.show.words.width import ELSEWHERE

CONTEXT = ReportContext(command="whyhot replay 1_s1", store_head="4f0c91", versions={"whyhot": "0.1.0"})


@pytest.fixture(scope="module")
def html(tmp_path_factory: pytest.TempPathFactory) -> str:
    """The report of one session."""
    return page(tmp_path_factory.mktemp("report"), made_run())


@pytest.fixture(scope="module")
def two(tmp_path_factory: pytest.TempPathFactory) -> str:
    """The report of two sessions."""
    return page(tmp_path_factory.mktemp("reports"), made_run(), made_run("2_s2"))


def page(tmp_path: Path, *runs: Run, context: ReportContext = CONTEXT) -> str:
    write_report(runs, tmp_path / "report.html", context)
    return (tmp_path / "report.html").read_text(encoding="utf-8")


class Tags(HTMLParser):
    """Every opening tag with its attributes, and the text."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.text = ""
        self.feed(html)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))

    def handle_data(self, data: str) -> None:
        self.text += data


def test_the_answer_names_the_worst_node_how_far_off_which_way_and_where() -> None:
    assert answer([made_run().summary]) == (
        "The model is furthest off at the rotor surface: 3.1 K on average and 6.0 K at worst, mostly too cold, "
        "most at 3,200 to 3,500 rpm. Within the sensors' own uncertainty: winding and stator."
    )


def test_the_answer_names_the_channel_where_the_worst_node_has_several() -> None:
    run = made_run()
    worst = max(run.summary.channels, key=lambda one: one.mae_K)
    beside = replace(worst, channel="T_beside", mae_K=1.0)
    summary = replace(run.summary, channels=[*run.summary.channels, beside])
    assert f"rotor surface: 3.1 K ({worst.channel}) on average" in answer([summary])
    assert f"and 3.1 K ({worst.channel}) in 1_s1, its worst" in answer([summary, summary])


def test_the_answer_over_several_sessions_gives_the_mean_and_the_worst_session() -> None:
    text = answer([made_run().summary, made_run("2_s2", masked=(0, 1200)).summary])
    assert "4.6 K on average over 2 recordings, and 6.0 K in 2_s2, its worst (mostly too cold" in text


def test_a_model_within_the_floor_is_said_to_agree() -> None:
    assert answer([made_run(masked=(1200, 2400)).summary]) == (
        "The model agrees with this recording on average within the sensors' own uncertainty (0.5 K)."
    )


def test_recordings_without_a_usable_channel_get_an_honest_answer() -> None:
    run = made_run()
    assert answer([replace(run.summary, channels=[])]).startswith("Nothing can be said")


def test_a_finding_within_the_floor_compares_with_the_floor() -> None:
    summary = made_run().summary
    winding = worst_first(summary)[1]
    assert (
        finding(winding, summary)
        == "Winding: 0.2 K off on average, 0.2 K at worst; the sensor itself leaves 0.5 K open"
    )


@pytest.mark.parametrize(
    ("loss", "heat", "says"),
    [
        (1000.0, 400.0, "1,000 W against 400 W (2.5 times). What the network lacks may be the inverter's loss"),
        (300.0, 400.0, "The model makes more heat than was lost"),
        (410.0, 400.0, "They agree within 15 %."),
        (-5.0, 400.0, "check the signs of power, torque and speed"),
    ],
)
def test_the_power_balance_says_what_the_difference_may_be(loss: float, heat: float, says: str) -> None:
    summary = replace(made_run().summary, electrical_minus_mechanical_W=loss, network_heat_W=heat)
    assert says in power_balance([summary])[0]


def test_of_many_sessions_three_balances_are_told() -> None:
    one = replace(made_run().summary, electrical_minus_mechanical_W=1000.0, network_heat_W=400.0)
    (told,) = power_balance([replace(one, session_name=f"s{i}") for i in range(5)])
    assert "s2 1,000 W against 400 W (2.5 times) and 2 more. What" in told and "s3" not in told


def test_without_recorded_power_there_is_no_balance() -> None:
    assert power_balance([replace(made_run().summary, electrical_minus_mechanical_W=None)]) == []


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (clock(4360.4), "1:12:40"),
        (words.duration(9599.5), "2 h 40 min"),
        (words.duration(45), "45 s"),
        (words.signed_kelvin(-0.04), "0.0 K"),
        (words.signed_kelvin(-4.36), "−4.4 K"),
        (
            words.where({"speed_rpm": [8012.0, 16000.0], "t_s": [0, 60]}),
            "at 8,000 to 16,000 rpm and from 0:00:00 to 0:01:00",
        ),
        (words.where({}), ""),
        (words.where({"speed_rpm": [5690.0, 5712.0], "current_A": [7.0, 8.0]}), "at 5,700 rpm and at 7 to 8 A"),
        (words.joined(["a", "b", "c"]), "a, b and c"),
    ],
)
def test_numbers_are_written_as_people_say_them(text: str, expected: str) -> None:
    assert text == expected


def test_the_terminal_text_puts_the_answer_first_and_the_next_command_last_within_100_columns() -> None:
    long = made_run("a_very_long_session_name_of_a_bench_that_likes_to_be_precise", masked=(0, 100))
    lines = replay_text([made_run().summary, long.summary], "whyhot report 1_s1").splitlines()
    assert lines[0].startswith("What is wrong     The model is furthest off at the rotor surface")
    assert lines[-1] == "Next              whyhot report 1_s1"
    assert max(map(len, lines)) <= ELSEWHERE


def test_a_number_and_its_unit_are_not_parted_by_a_line() -> None:
    for length in range(60, 90):
        lines = labelled("Gain", "x" * length + " 3.6 K · 41 % of 1 h and 1.6 -> 0.7 K in 2 seconds")
        assert not [line for line in lines if re.match(r" +(K|%|h|->|0.7) ", line)], lines
        assert "\N{NO-BREAK SPACE}" not in "".join(lines)
    assert labelled("Gain", "x" * 79 + " 2 seconds")[1].strip() == "seconds"


@pytest.mark.parametrize(("columns", "name"), [(60, "1"), (100, "a_name_that_likes_to_be_precise" * 3), (140, "1_s1")])
def test_a_session_has_at_most_four_lines_and_begins_with_its_highest_reading(
    columns: int, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", str(columns))
    run = made_run(name)
    many = [replace(one, channel=f"{one.channel}{i}") for i in range(9) for one in run.summary.channels]
    spots = {"winding": ModelledSpot(node="winding", max_degC=171.0, at_s=1.0, limit_degC=180.0, margin_K=9.0)}
    _, session, *_ = replay_text([replace(run.summary, channels=many, hot_spots=spots)], "next").split("\n\n")
    lines = session.splitlines()
    assert len(lines) == 4 and max(map(len, lines)) <= columns
    assert lines[0].startswith(f"{name if len(name) < 40 else name[:39] + '…'}   rotor surface (T_30) measured up to ")
    assert lines[1].startswith("  model, on average:") and lines[1].endswith(" …")
    assert lines[2].startswith("  hottest by the model: winding 171 °C, 9.0 K under its ")
    assert lines[3].startswith("  no filter: the motor has no magnet and no rotor whose ")


def test_what_does_not_fit_is_left_out_whole_and_no_number_is_cut(monkeypatch: pytest.MonkeyPatch) -> None:
    spots = {
        name: ModelledSpot(
            node=name, max_degC=121.4, at_s=1.0, limit_degC=180.0, margin_K=58.6, ci95_degC=[96.8, 140.2]
        )
        for name in ("winding", "magnet")
    }
    whole = {"winding 121 °C (97 to 140), 58.6 K under its limit", "magnet 121 °C (97 to 140), 58.6 K under its limit"}
    for columns in range(60, 141):
        monkeypatch.setenv("COLUMNS", str(columns))
        text = replay_text([replace(made_run().summary, hot_spots=spots)], "next")
        line = next(line for line in text.splitlines() if line.startswith("  hottest"))
        told = line.removeprefix("  hottest by model, 95 %: ").removesuffix("; …")
        assert columns < 80 or {*told.split("; ")} <= whole, line


def test_what_of_a_session_was_not_replayed_is_said() -> None:
    summary = replace(made_run().summary, note="0:51:00 to 1:30:00 replayed: elsewhere inputs are silent")
    text = replay_text([summary, made_run("2_s2").summary], "next")
    assert "Left out          1_s1: 0:51:00 to 1:30:00 replayed: elsewhere inputs are silent" in text
    assert "Left out" not in replay_text([made_run().summary], "next")


def test_the_terminal_says_of_each_node_how_far_off_which_way_and_what_the_sensor_leaves_open(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("COLUMNS", "140")
    run = made_run(masked=(0, 100))
    limits = {"winding": LimitPassed(limit_degC=70.0, above_s=1.0, max_degC=81.0)}
    text = replay_text([replace(run.summary, limits=limits)], "whyhot report 1_s1")
    highest, winding = (max(run.observed[j].measured) for j in (2, 0))
    assert f"1_s1   rotor surface measured up to {highest:.1f} °C at 0:40:00; " in text
    assert f"; winding measured up to {winding:.1f} °C at 0:40:00, {winding - 70:.1f} K ABOVE its limit; " in text
    assert "  model, on average: rotor surface 3.2 K too cold (6.0 K at worst); " in text
    assert "; winding and stator within the sensors' own uncertainty (0.5 K); 100\n    steps of T_3 masked" in text


def test_what_the_file_corrects_is_said_beside_the_highest_reading_and_the_error() -> None:
    run = made_run()
    moved = [replace(one, mae_recorded_K=5.0, reading_moved_K=-1.7) for one in run.summary.channels]
    text = replay_text([replace(run.summary, channels=moved)], "next")
    assert re.search(r"measured up to [\d.]+ °C at 0:40:00 \(reading corrected\); ", text)
    assert "average: rotor surface 3.1 K (reading corrected by −1.7 K; as recorded 5.0 K) too cold" in text


def test_runs_that_were_sealed_without_the_highest_reading_are_told_without_it() -> None:
    run = made_run()
    old = [replace(one, measured_max_degC=None) for one in run.summary.channels]
    assert "\n1_s1   s1, 40 min; model " in replay_text([replace(run.summary, channels=old)], "next")


def test_the_report_tells_in_order_answer_sessions_maps_balance_and_source(two: str) -> None:
    text = Tags(re.sub(r"<nav.*?</nav>", "", two)).text.replace("\N{NO-BREAK SPACE}", " ")
    order = (
        "The model is furthest off at the rotor surface",
        "How far off, and where",
        "Session by session",
        "2025-10-09 08:53 UTC",
        "What drove it",
        "Where in operation",
        "Power balance",
        "What this was computed from",
    )
    places = [text.index(part) for part in order]
    assert places == sorted(places)
    for source in ("whyhot replay 1_s1", "4f0c91", "0.1.0", "9ac1f00d" * 8, "4f0cbeef" * 8):
        assert source in text


def test_replays_of_different_models_or_levels_are_told_apart(two: str) -> None:
    first, second = made_run(), made_run("2_s2")
    assert mixed([first, second]) == "" and "Not all of one model" not in two
    assert mixed([first, replace(second, model="5fa005c2" * 8)]).startswith(
        "Not all of one model and level: 1_s1 with 9ac1f00d (level testing); 2_s2 with 5fa005c2 (level"
    )
    assert "2_s2 with 9ac1f00d (level production)" in mixed([first, replace(second, level="production")])


def test_nothing_leaves_the_report(html: str) -> None:
    assert "http:" not in html and "https:" not in html and "url(" not in re.sub(r"url\(#\w+\)", "", html)
    tags = Tags(html).tags
    assert [own for tag, own in tags if tag == "script"] == [{}], "ours, in the page"
    assert not {tag for tag, _ in tags} & {"link", "img", "iframe", "object", "base", "form"}
    policy = next(a["content"] for tag, a in tags if tag == "meta" and a.get("http-equiv") == "Content-Security-Policy")
    script = html[html.index("<script>") + 8 : html.index("</script>")]
    own = b64encode(sha256(script.encode()).digest()).decode()
    assert policy == f"default-src 'none'; style-src 'unsafe-inline'; script-src 'sha256-{own}'"
    assert all(a["href"] and a["href"].startswith("#") for _, a in tags if "href" in a)


def test_every_plot_has_a_title_and_its_data_behind_a_fold(html: str) -> None:
    tags = [tag for tag, _ in Tags(html).tags]
    assert tags.count("figure") == tags.count("figcaption") == tags.count("details") == tags.count("svg") == 6


def test_ids_in_the_drawings_are_unique_so_that_clips_cannot_mix_up(two: str) -> None:
    ids = [a["id"] for _, a in Tags(two).tags if "id" in a]
    assert len(ids) == len(set(ids)) > 0


def test_the_report_knows_dark_pages_and_paper(html: str) -> None:
    assert "@media screen and (prefers-color-scheme: dark)" in html
    assert "@page { size: A4 landscape;" in html


HOSTILE = '<script>alert("1")</script> & $x^2$ \'"<img src=x>'


def test_hostile_names_stay_text(tmp_path: Path) -> None:
    run = made_run(HOSTILE, motor=HOSTILE, kind=HOSTILE)
    context = ReportContext(command=HOSTILE, store_head=HOSTILE, versions={HOSTILE: HOSTILE})
    parsed = Tags(page(tmp_path, run, context=context))
    assert [tag for tag, _ in parsed.tags if tag in ("script", "img")] == ["script"], "ours alone"
    assert parsed.text.count("alert(") >= 5


def test_hostile_channel_names_stay_text_in_the_drawings(tmp_path: Path) -> None:
    run = made_run()
    node = {o.node: f"{o.node}{HOSTILE}" for o in run.observed}
    observed = tuple(o.__class__(**{**vars(o), "node": node[o.node], "channel": HOSTILE}) for o in run.observed[:1])
    channels = [replace(one, node=node[one.node], channel=HOSTILE) for one in run.summary.channels[:1]]
    hostile = replace(run, observed=observed, summary=replace(run.summary, channels=channels))
    parsed = Tags(page(tmp_path, hostile))
    assert [tag for tag, _ in parsed.tags if tag in ("script", "img")] == ["script"], "ours alone"


def test_a_session_without_absolute_time_counts_from_its_start(tmp_path: Path) -> None:
    html = page(tmp_path, made_run(absolute=False))
    assert "no absolute time" in html and "time since start [min]" in html and "UTC" not in html


def test_a_session_without_a_usable_channel_is_still_listed(tmp_path: Path) -> None:
    run = made_run()
    empty = replace(run, observed=(), summary=replace(run.summary, channels=[]))
    assert "no channel of this session observes a node" in page(tmp_path, empty)


def test_the_same_runs_give_the_same_bytes(html: str, tmp_path: Path) -> None:
    assert page(tmp_path, made_run()) == html


def test_a_line_takes_no_more_than_its_share_of_5_megabytes(tmp_path: Path) -> None:
    noise = np.random.default_rng(1).normal(0, 1, 20_000)
    run = made_run(steps=20_000)
    observed = tuple(
        o.__class__(**{**vars(o), "channel": f"{o.channel}_{i}", "measured": o.measured + noise})
        for i in range(4)
        for o in run.observed
    )
    channels = [replace(one, channel=f"{one.channel}_{i}") for i in range(4) for one in run.summary.channels]
    long = replace(run, observed=observed, summary=replace(run.summary, channels=channels))
    assert len(page(tmp_path, long).encode()) < 5_000_000 * 3 * len(observed) / LINES
