"""Where `whyhot envelope` may write its picture."""

from __future__ import annotations

from pathlib import Path

import pytest

from replay.cli import main


@pytest.mark.parametrize("name", ["x.png", "x", "x.svg.gz"])
def test_a_picture_that_is_no_svg_is_refused_before_anything_is_read(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as refused:
        main(["envelope", "--on", "1_s1", "--out", str(tmp_path / name), "--store", str(tmp_path / "none")])
    assert refused.value.code == 2
    said = capsys.readouterr().err
    assert f'argument -o/--out: an SVG is written, and a .png beside it: end "{tmp_path / name}" in .svg' in said
    assert not list(tmp_path.iterdir())
