"""The reports as a browser lays them out."""

from __future__ import annotations

import csv
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from made.ageing import aged
from made.browser import as_it_stands, faults, in_browser
from made.diagnoses import KEPT, NAMED, TRAIN, runs, session_id
from made.pictured import with_all_pictures
from made.runs import made_run
from made.seen import filtered, network
from replay.show.reports.ageing_report import write_ageing_report
from replay.show.reports.diagnosis_report import write_diagnosis_report
from replay.show.reports.report import ReportContext, write_report

CONTEXT = ReportContext(command="whyhot report", store_head="4f0c91", versions={"whyhot": "0.1.0"})


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    target = tmp_path_factory.mktemp("report") / "page.html"
    write_report([with_all_pictures(), made_run("2_s2")], target, CONTEXT)
    return target


@pytest.fixture(scope="module")
def diagnosis(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """With a filter over one of its sessions."""
    target = tmp_path_factory.mktemp("diagnosis") / "page.html"
    of_sessions = runs(names=(TRAIN[0], KEPT[-1]))
    kept = of_sessions[session_id(KEPT[-1])]
    kept["published"] = replace(kept["published"], filtered=filtered())
    write_diagnosis_report(NAMED, of_sessions, network(), "", target, CONTEXT)
    return target


@pytest.fixture(scope="module")
def ageing(tmp_path_factory: pytest.TempPathFactory) -> Path:
    target = tmp_path_factory.mktemp("ageing") / "page.html"
    write_ageing_report(aged(), target, CONTEXT)
    return target


@pytest.fixture(params=["report", "diagnosis", "ageing"])
def page(request: pytest.FixtureRequest) -> Path:
    found: Path = request.getfixturevalue(request.param)
    return found


def test_a_page_is_as_it_should_be_however_wide_the_screen_and_whoever_reads_it(page: Path) -> None:
    assert faults(page) == []


def test_contents_lead_to_every_section(page: Path) -> None:
    script = """
    return [...document.querySelectorAll("h2")].map(title => {
      const link = document.querySelector(`nav a[href="#${title.id}"]`);
      return [title.textContent, link ? link.textContent : null];
    });
    """
    sections = in_browser(page, script)
    assert len(sections) > 3
    assert all(title == link for title, link in sections)


def test_values_can_be_read_off_every_line_over_time_or_speed_with_what_drove_the_motor_below(page: Path) -> None:
    text = re.sub(r"<h2[^>]*>Where in operation.*?</section>", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    drawn = re.findall(r'<svg [^>]*aria-label="([^"]*)">(.*?)</svg>', text)
    over = [(title, svg) for title, svg in drawn if re.search(r">(?:time since start|speed) \[", svg)]
    assert {title for title, svg in over if "data-line" not in svg} == set()
    alone = [title for title, svg in over if 'data-line="speed [of' not in svg]
    assert all(title.startswith(("What drove it", "S1 at", "Magnet at 12,000 rpm")) for title in alone), alone


POINT = """
const at = (plot, type, share, pressed = 0) => {
  const box = plot.panels[0].box, corner = plot.svg.getScreenCTM();
  const place = new DOMPoint(box.left + share * (box.right - box.left), box.top + 2).matrixTransform(corner);
  const buttons = type === "pointermove" ? pressed : 1;
  plot.svg.dispatchEvent(new PointerEvent(type, {clientX: place.x, clientY: place.y, bubbles: true, buttons}));
};
"""


def test_the_script_runs_under_the_pages_own_policy(one: Path) -> None:
    assert "script-src 'sha256-" in one.read_text(encoding="utf-8")
    assert 'aria-pressed="true"' in as_it_stands(one)


@pytest.fixture(scope="module")
def one(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The report of one run, 40 min long."""
    target = tmp_path_factory.mktemp("one") / "page.html"
    write_report([made_run()], target, CONTEXT)
    return target


def test_the_cursor_tells_the_values_that_are_drawn_in_every_plot_of_the_session(one: Path) -> None:
    told = in_browser(
        one, POINT + "at(plots[0], 'pointermove', 0.75); return plots.map(plot => plot.told.textContent);"
    )
    run = made_run()
    winding, stator, rotor = (float(o.modelled[1800]) for o in run.observed)
    assert all(text.startswith("30.000 min: ") for text in told)
    for name, value in {"winding": winding, "stator": stator, "rotor surface": rotor}.items():
        (says,) = {part for text in told for part in text.split(": ", 1)[1].split(" · ") if f"{name} model" in part}
        assert float(says.rsplit(" ", 1)[1]) == pytest.approx(value, abs=0.1)
    assert any("speed [rpm] 3500" in text for text in told)


def test_a_brush_shows_the_same_time_in_every_plot_of_the_session_and_the_csv_holds_what_is_seen(one: Path) -> None:
    script = """
    at(plots[0], "pointerdown", 0.25);
    at(plots[0], "pointermove", 0.5, 1);
    const marked = plots.map(plot => plot.mark.getAttribute("d").match(/M/g).length / plot.panels.length);
    at(plots[0], "pointerup", 0.5);
    const ticks = plots[1].ticks.filter(tick => tick.says).map(tick => Number(tick.text.textContent));
    return [plots.map(plot => plot.seen), csv(plots[0]), ticks, marked];
    """
    seen, text, ticks, marked = in_browser(one, POINT + script)
    assert set(marked) == {2}, "both ends of what will be seen, in every panel"
    assert all(range_ == pytest.approx([10.0, 20.0], abs=0.01) for range_ in seen)
    head, *rows = [[cell.strip('"') for cell in line.split('","')] for line in text.splitlines()]
    assert head == ["line", "min", "value"]
    times = [float(row[1]) for row in rows]
    assert (min(times), max(times)) == pytest.approx((10.0, 20.0), abs=0.01)
    lines = {f"winding {what}" for what in ("measured [°C]", "model [°C]", "residual [K]")}
    assert {row[0] for row in rows} == lines | {"speed [of 3,500 rpm]", "current [of 120 A]"}
    model = [(float(time), float(value)) for name, time, value in rows if name == "winding model [°C]"]
    drawn = np.interp([time for time, _ in model], (np.arange(2400) + 0.5) / 60, made_run().observed[0].modelled)
    assert [value for _, value in model] == pytest.approx(drawn.tolist(), abs=0.1)
    assert ticks and all(9.9 <= tick <= 20.1 for tick in ticks)


def test_a_brush_that_ends_beside_the_picture_goes_to_its_edge_and_another_button_begins_none(one: Path) -> None:
    script = """
    at(plots[0], "pointerdown", 0.5);
    document.body.dispatchEvent(new PointerEvent("pointerup", {clientX: innerWidth - 1, clientY: 1, bubbles: true}));
    const seen = plots[0].seen;
    zoom(plots[0], null);
    plots[0].svg.dispatchEvent(new PointerEvent("pointerdown", {clientX: 0, clientY: 0, button: 2, buttons: 2}));
    at(plots[0], "pointerup", 0.9);
    return [seen, plots[0].zoomed(), getComputedStyle(plots[0].svg).userSelect];
    """
    seen, zoomed, selects = in_browser(one, POINT + script)
    assert (seen, zoomed) == (pytest.approx([20.0, 40.0], abs=0.01), False)
    assert selects == "none", "selected text would be dragged along by the next brush"


def test_the_csv_has_no_value_where_a_gap_of_a_line_begins(tmp_path: Path) -> None:
    write_report([made_run(masked=(600, 1200))], tmp_path / "page.html", CONTEXT)
    text = in_browser(
        tmp_path / "page.html", "return csv(plots.find(plot => plot.panels[0].lines[0].name.startsWith('rotor')));"
    )
    rows = list(csv.reader(text.splitlines()))
    (begins,) = [float(time) for name, time, value in rows if name == "rotor surface measured [°C]" and not value]
    assert begins == pytest.approx(10.0, abs=0.1)


def test_bands_and_rows_of_colours_go_along_with_the_lines_that_are_zoomed(report: Path) -> None:
    script = """
    zoom(plots[0], [10, 20]);
    return plots.filter(plot => plot.zoomed()).flatMap(plot => plot.panels).flatMap(({box, lines, moves}) => {
      const xs = moves.slice(lines.length).flatMap(({path}) => points(path.getAttribute("d")).flat().map(([x]) => x));
      return xs.length ? [(Math.max(...xs) - Math.min(...xs)) / (box.right - box.left)] : [];
    });
    """
    wide = in_browser(report, script)
    assert wide == pytest.approx([4.0, 4.0], abs=0.01), "the strip of residuals, the estimated heat"


def test_a_brush_over_speed_leaves_what_is_over_time(diagnosis: Path) -> None:
    script = """
    const law = plots.find(plot => plot.unit === "rpm");
    at(law, "pointerdown", 0.25);
    at(law, "pointerup", 0.5);
    at(law, "pointermove", 0.5);
    return [law.seen, plots.filter(plot => plot.zoomed()).length, law.told.textContent];
    """
    seen, zoomed, told = in_browser(diagnosis, POINT + script)
    assert (seen, zoomed) == (pytest.approx([4000.0, 8000.0], abs=10.0), 1)
    assert told.startswith("6,000 rpm: as published [W] ")


def test_temperatures_stand_over_speed_where_that_is_asked_for(one: Path) -> None:
    script = """
    const press = [...document.querySelectorAll("button")].find(made => made.textContent === "over speed");
    press.click();
    const xy = press.closest("figure").querySelector("svg[aria-label='temperatures over speed']");
    const dots = xy.querySelectorAll("circle").length, says = [...xy.querySelectorAll("text")].map(t => t.textContent);
    zoom(plots[0], [0, 10]);
    const few = [...xy.querySelectorAll("text")].map(t => t.textContent);
    press.click();
    return [dots, says, few, xy.isConnected];
    """
    dots, says, few, shown = in_browser(one, script)
    assert dots == 2 * 500, "of what is measured and of the model"
    assert {"2,000", "3,000", "speed [rpm]"} <= set(says)
    assert "3,000" not in few, "what is seen is at 1,500 rpm"
    assert not shown


def test_a_slider_leads_the_picture_of_the_cut_through_the_session(diagnosis: Path) -> None:
    script = """
    const svg = document.querySelector("svg[data-over-time]"), slider = svg.closest("figure").querySelector("input");
    const shown = () => [svg.querySelector("[data-part='rotor_surface'] path").style.fill,
      svg.querySelector("[data-says='rotor_surface'] text").textContent,
      svg.querySelector("[data-flow='0'] path").style.strokeWidth, slider.nextSibling.textContent];
    const still = shown();
    slider.value = 0;
    slider.dispatchEvent(new Event("input"));
    return [still, shown()];
    """
    still, first = in_browser(diagnosis, script)
    assert still[1] == "rotor surface +6.0 K" and first[1] == "rotor surface −0.2 K" and first[3] == "0:00:25"
    assert still[0] != first[0] and float(first[2]) < float(still[2]), "nothing flows in a motor of one temperature"


def test_a_click_on_a_name_hides_its_line_and_takes_it_out_of_the_csv(one: Path) -> None:
    script = """
    const [line] = plots[0].panels[0].lines;
    [...plots[0].svg.closest("figure").querySelectorAll("button")].find(made => made.textContent === line.name).click();
    return [line.line.style.display, csv(plots[0]).includes(line.name), line.name];
    """
    assert in_browser(one, script) == ["none", False, "winding measured [°C]"]
