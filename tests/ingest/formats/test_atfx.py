"""ATFX: the model that a file says of itself, its columns in every form that is read, and what is left out."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from ingest.errors import UnreadableLogError
from ingest.formats import TimeSpec, recognise
from made.every_format import write_atfx
from made.places import LOGS
from made.tables import read

BEGIN_NS = 1_742_220_120_000_000_000  # 2025-03-17 14:02:00 UTC
BEGUN = "<measurement_begin>20250317140200000000</measurement_begin>"
NAMES = {
    "AoMeasurement": "id name measurement_begin",
    "AoMeasurementQuantity": "id name unit",
    "AoSubmatrix": "id name number_of_rows measurement",
    "AoLocalColumn": "id independent sequence_representation generation_parameters flags global_flag values "
    "measurement_quantity submatrix",
    "AoUnit": "id name",
}


def column(key: int, name: str, values: str, unit: str = "", more: str = "", how: str = "explicit", of: int = 1) -> str:
    return (
        f"<AoUnit><id>{key}</id><name>{unit}</name></AoUnit>"
        f"<AoMeasurementQuantity><id>{key}</id><name>{name}</name><unit>{key}</unit></AoMeasurementQuantity>"
        f"<AoLocalColumn><id>{key}</id><sequence_representation>{how}</sequence_representation>"
        f"<measurement_quantity>{key}</measurement_quantity><submatrix>{of}</submatrix>{more}"
        f"{f'<values>{values}</values>' if values else ''}</AoLocalColumn>\n"
    )


def submatrix(key: int, rows: int, name: str = "fast") -> str:
    return (
        f"<AoSubmatrix><id>{key}</id><name>{name}</name><number_of_rows>{rows}</number_of_rows>"
        "<measurement>1</measurement></AoSubmatrix>\n"
    )


def written(path: Path, *data: str, begun: str = BEGUN) -> Path:
    """A file whose elements and attributes are called as those of the base model."""
    model = "".join(
        f"<application_element><name>{kind}</name><basetype>{kind}</basetype>"
        + "".join(
            f"<application_attribute><name>{one}</name><base_attribute>{one}</base_attribute></application_attribute>"
            for one in names.split()
        )
        + "</application_element>\n"
        for kind, names in NAMES.items()
    )
    path.write_text(
        '<?xml version="1.0"?>\n<atfx_file xmlns="http://www.asam.net/ODS/5.3.0/Schema">\n'
        f"<application_model>{model}</application_model>\n<instance_data>"
        f"<AoMeasurement><id>1</id>{begun}</AoMeasurement>\n{''.join(data)}</instance_data></atfx_file>\n",
        encoding="utf-8",
    )
    return path


TIME = column(1, "t", "<A_FLOAT64>0 0.5 1</A_FLOAT64>", "s", "<independent>1</independent>")
DATES = "<A_TIMESTRING>20250317140200 20251317140200 202503171402015</A_TIMESTRING>"


def write_sample(path: Path) -> None:
    written(
        path,
        submatrix(1, 3),
        column(1, "when", DATES, "", "<independent>1</independent>"),
        column(
            2, "T_mag", "<A_FLOAT32>20.5 20.6 1e2</A_FLOAT32>", "degC", "<flags><A_INT16>15 15 14</A_INT16></flags>"
        ),
        column(3, "state", "<A_UTF8STRING><s>on</s><s>off</s><s>on</s></A_UTF8STRING>"),
    )


def test_the_sample_is_what_is_written_here_and_read_whole(tmp_path: Path) -> None:
    write_sample(tmp_path / "sample.atfx")
    assert (LOGS / "sample.atfx").read_text() == (tmp_path / "sample.atfx").read_text()
    log, t_ns, columns = read(LOGS / "sample.atfx")
    assert (t_ns, log.absolute, log.units) == ([BEGIN_NS, BEGIN_NS + 1_500_000_000], True, {"T_mag": "degC"})
    np.testing.assert_array_equal(columns["T_mag"], [20.5, np.nan])  # the second one that is kept is called invalid
    assert columns["state"] == ["on", "on"]
    assert [(one.record, one.where, one.why) for one in log.rejected] == [(1, 'group "fast", record 2', "no time")]


@pytest.mark.parametrize(
    ("how", "parameters", "values", "wanted"),
    [
        ("explicit", "", "<A_INT32>7 8 9</A_INT32>", [7, 8, 9]),
        ("explicit", "", "<A_BOOLEAN>1 false true</A_BOOLEAN>", [1, 0, 1]),
        ("raw_linear", "-40 0.5", "<A_INT8>100 102 0</A_INT8>", [10, 11, -40]),
        ("implicit_linear", "5 -2", "", [5, 3, 1]),
        ("implicit_constant", "23.5", "", [23.5] * 3),
    ],
)
def test_values_are_read_in_every_representation(
    tmp_path: Path, how: str, parameters: str, values: str, wanted: list[float]
) -> None:
    more = f"<generation_parameters>{parameters}</generation_parameters>"
    path = written(tmp_path / "a.atfx", submatrix(1, 3), TIME, column(2, "x", values, "", more, how))
    log, t_ns, columns = read(path)
    assert (t_ns, columns) == ([BEGIN_NS + k * 500_000_000 for k in range(3)], {"x": wanted})
    assert log.absolute and recognise(path).name == "atfx"


def test_dates_are_local_and_without_one_the_bench_file_says_the_start(tmp_path: Path) -> None:
    data = submatrix(1, 3), TIME, column(2, "x", "<A_INT32>7 8 9</A_INT32>")
    assert read(written(tmp_path / "a.atfx", *data), TimeSpec(zone="Europe/Rome"))[1][0] == BEGIN_NS - 3_600_000_000_000
    path = written(tmp_path / "b.atfx", *data, begun="")
    assert (read(path)[0].absolute, read(path)[1][1]) == (False, 500_000_000)
    assert read(path, TimeSpec(start_ns=BEGIN_NS))[1][1] == BEGIN_NS + 500_000_000


def test_submatrices_of_two_rates_are_rows_at_their_times(tmp_path: Path) -> None:
    slow = column(3, "t", "<A_INT32>500 2000</A_INT32>", "ms", "<independent>1</independent>", of=2)
    path = written(
        *(tmp_path / "a.atfx", submatrix(1, 3), TIME, column(2, "x", "<A_INT32>7 8 9</A_INT32>")),
        *(submatrix(2, 2, "slow"), slow, column(4, "x", "<A_INT32>1 2</A_INT32>", of=2)),
    )
    log, t_ns, columns = read(path)
    assert [t - BEGIN_NS for t in t_ns] == [0, 500_000_000, 1_000_000_000, 2_000_000_000]
    np.testing.assert_array_equal(columns["fast/x"], [7, 8, 9, np.nan])
    np.testing.assert_array_equal(columns["slow/x"], [np.nan, 1, np.nan, 2])
    assert log.settings["groups"] == {"fast": 3, "slow": 2}


def test_what_is_not_read_is_named(tmp_path: Path) -> None:
    outside = "<component><identifier>a.bin</identifier><length>3</length></component>"
    path = written(
        *(tmp_path / "a.atfx", submatrix(1, 3), TIME, column(2, "x", "<A_INT32>7 8 9</A_INT32>")),
        column(3, "far", outside, how="external_component"),
        column(4, "z", "<A_COMPLEX32>1 2 3 4 5 6</A_COMPLEX32>"),
        column(5, "bad", "<A_INT32>7 eight 9</A_INT32>"),
        *(submatrix(2, 2, "plate"), column(6, "hz", "<A_INT32>1 2</A_INT32>", "Hz", of=2)),
    )
    log, _, columns = read(path)
    assert list(columns) == ["x"]
    assert log.settings["unconverted"] == {
        "fast/far": "its values lie in a file beside it (a.bin): export it with its values in the file",
        "fast/z": "values of the kind A_COMPLEX32, explicit, are not read",
        "fast/bad": "a value of it is no number",
        "plate": "nothing in it says a time",
    }
    alone = written(tmp_path / "b.atfx", submatrix(1, 3), column(3, "far", outside, how="external_component"))
    with pytest.raises(UnreadableLogError, match=r"b\.atfx: no row .*: fast/far: its values lie in a file beside it "):
        read(alone)


def test_a_file_that_was_cut_keeps_what_was_whole(tmp_path: Path) -> None:
    path = tmp_path / "a.atfx"
    write_atfx(path, [(0.0, 20.0), (0.5, 21.0)])
    text = path.read_text()
    path.write_text(text[: text.rindex("</instance_data>") + 3])
    log, t_ns, columns = read(path)
    assert (len(t_ns), columns["TC_winding"]) == (2, [20, 21])
    assert log.cut is not None and log.cut.startswith("is no whole XML (")
