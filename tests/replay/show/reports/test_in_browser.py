"""The reports as a browser lays them out."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from made.browser import LABELS, in_browser
from made.diagnoses import NAMED, runs
from made.runs import made_run
from replay.engine.results.run import Run
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


@pytest.fixture(scope="module", params=["report", "diagnosis"])
def page(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    target = tmp_path_factory.mktemp(request.param) / "page.html"
    if request.param == "report":
        write_report([with_a_long_name(), made_run("2_s2")], target, CONTEXT)
    else:
        write_diagnosis_report(NAMED, runs(), "", target, CONTEXT)
    return target


def test_no_label_of_a_picture_is_cut_or_lies_over_another(page: Path) -> None:
    assert in_browser(page, LABELS) == []


def test_on_a_telephone_pictures_stay_readable_and_the_page_is_no_wider_than_the_screen(page: Path) -> None:
    script = """
    const heights = [...document.querySelectorAll("svg text")].map(text => text.getBoundingClientRect().height);
    const whole = document.documentElement;
    return [whole.scrollWidth - whole.clientWidth, Math.min(...heights.filter(height => height > 0))];
    """
    beyond, smallest = in_browser(page, script, width=500)  # Chromium's window gets no narrower
    assert beyond <= 0
    assert smallest >= 9


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
