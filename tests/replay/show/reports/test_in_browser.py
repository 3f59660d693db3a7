"""The reports as a browser lays them out."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from made.ageing import aged
from made.browser import LABELS, as_it_stands, axe, in_browser
from made.diagnoses import NAMED, runs
from made.runs import heated, made_run
from made.seen import network
from replay.engine.results.run import Run
from replay.show.reports.ageing_report import write_ageing_report
from replay.show.reports.diagnosis_report import write_diagnosis_report
from replay.show.reports.report import ReportContext, write_report

CONTEXT = ReportContext(command="whyhot report", store_head="4f0c91", versions={"whyhot": "0.1.0"})
LONG = "endwinding_b_outer_turn_3_of_phase_v"


def with_a_long_name() -> Run:
    """Its winding is called LONG."""
    run = made_run(masked=(100, 400))
    nodes = (LONG, *run.nodes[1:])
    observed = tuple(replace(o, node=LONG if o.node == "winding" else o.node) for o in run.observed)
    channels = [replace(c, node=LONG if c.node == "winding" else c.node) for c in run.summary.channels]
    regions = dict.fromkeys(nodes, "copper")
    summary = replace(run.summary, channels=channels)
    return replace(run, nodes=nodes, regions=regions, observed=observed, summary=summary)


@pytest.fixture(scope="module", params=["report", "diagnosis", "ageing"])
def page(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    target = tmp_path_factory.mktemp(request.param) / "page.html"
    if request.param == "report":
        kinds = {"copper_dc": 600.0, "copper_ac": 150.0, "iron": 200.0, "magnet": 4.0, "mechanical": 4.0, "other": 1.0}
        taken = {"coolant": 900.0, LONG: 1.0, "ambient": 1.0, "plate": -50.0}
        write_report([heated(with_a_long_name(), kinds, taken), made_run("2_s2")], target, CONTEXT)
    elif request.param == "ageing":
        write_ageing_report(aged(), target, CONTEXT)
    else:
        write_diagnosis_report(NAMED, runs(), network(), "", target, CONTEXT)
    return target


def test_no_label_of_a_picture_is_cut_or_lies_over_another(page: Path) -> None:
    assert in_browser(page, LABELS) == []


def test_on_a_telephone_pictures_stay_readable_and_the_page_is_no_wider_than_the_screen(page: Path) -> None:
    script = """
    const heights = [...document.querySelectorAll("svg text")].map(text => text.getBoundingClientRect().height);
    const whole = document.documentElement;
    return [whole.scrollWidth - whole.clientWidth, Math.min(...heights.filter(height => height > 0))];
    """
    beyond, smallest = in_browser(page, script, width=390)
    assert beyond <= 0
    assert smallest >= 9


def test_nothing_keeps_people_who_see_little_or_use_no_mouse_from_a_page(page: Path) -> None:
    assert in_browser(page, axe(), width=390) == []


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


POINT = """
const at = (plot, type, share) => {
  const box = plot.panels[0].box, corner = plot.svg.getScreenCTM();
  const place = new DOMPoint(box.left + share * (box.right - box.left), box.top + 2).matrixTransform(corner);
  plot.svg.dispatchEvent(new PointerEvent(type, {clientX: place.x, clientY: place.y, bubbles: true}));
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
    at(plots[0], "pointerup", 0.5);
    const ticks = plots[1].ticks.filter(tick => tick.says).map(tick => Number(tick.text.textContent));
    return [plots.map(plot => plot.seen), csv(plots[0]), ticks];
    """
    seen, text, ticks = in_browser(one, POINT + script)
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


def test_a_slider_leads_the_picture_of_the_cut_through_the_session(page: Path) -> None:
    if "data-over-time" not in page.read_text(encoding="utf-8"):
        pytest.skip("only the report of a diagnosis has it")
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
    still, first = in_browser(page, script)
    assert still[1] == "rotor surface +6.0 K" and first[1] == "rotor surface −0.2 K" and first[3] == "0:00:25"
    assert still[0] != first[0] and float(first[2]) < float(still[2]), "nothing flows in a motor of one temperature"


def test_a_click_on_a_name_hides_its_line_and_takes_it_out_of_the_csv(one: Path) -> None:
    script = """
    const [line] = plots[0].panels[0].lines;
    [...plots[0].svg.closest("figure").querySelectorAll("button")].find(made => made.textContent === line.name).click();
    return [line.line.style.display, csv(plots[0]).includes(line.name), line.name];
    """
    assert in_browser(one, script) == ["none", False, "winding measured [°C]"]
