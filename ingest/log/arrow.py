"""numpy to Arrow and back, without a copy and without pandas.

`pyarrow.array` and `to_numpy` import pandas wherever it is installed: most of the time that reading one log takes.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray


def from_numpy(values: NDArray[Any]) -> pa.Array:
    """Numbers (N,) as an Arrow array of the same type; text (object, str or None) as strings."""
    if values.dtype == object:
        return pa.array(values.tolist(), pa.string())
    buffer = pa.py_buffer(np.ascontiguousarray(values))
    return pa.Array.from_buffers(pa.from_numpy_dtype(values.dtype), len(values), [None, buffer])


def to_numpy(array: pa.Array) -> NDArray[Any]:
    """The inverse of `from_numpy`, read-only for numbers."""
    if pa.types.is_string(array.type):
        return np.array(array.to_pylist(), dtype=object)
    return np.from_dlpack(array)
