"""numpy to Arrow and back: the values, and what is not imported on the way."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ingest.log.arrow import from_numpy, to_numpy
from made.places import ROOT


@pytest.mark.parametrize("dtype", [np.int64, np.int32, np.uint32, np.uint8, np.float64])
@pytest.mark.parametrize("count", [0, 1, 1000])
def test_numbers_come_back_with_their_type(dtype: type, count: int) -> None:
    values: NDArray[Any] = np.arange(2 * count).astype(dtype)[::2]
    array = from_numpy(values)
    assert array.validate(full=True) is None
    found = to_numpy(array)
    assert found.dtype == dtype
    np.testing.assert_array_equal(found, values)


def test_a_slice_is_only_the_slice() -> None:
    assert to_numpy(from_numpy(np.arange(10)).slice(3, 4)).tolist() == [3, 4, 5, 6]


def test_text_comes_back_with_its_empty_cells() -> None:
    values = np.array(["S-1", None, "°"], object)
    assert to_numpy(from_numpy(values)).tolist() == ["S-1", None, "°"]


def test_pandas_is_not_imported_where_it_is_installed(tmp_path: Path) -> None:
    (tmp_path / "pandas.py").write_text("")
    code = (
        f"import sys; sys.path[:0] = [{str(tmp_path)!r}, {str(ROOT)!r}]\n"
        "import numpy as np; from ingest.log.arrow import from_numpy, to_numpy\n"
        "to_numpy(from_numpy(np.arange(3)))\n"
        "sys.exit('pandas' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
