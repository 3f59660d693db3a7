"""What surrounds a fit: one thread for its small matrices, and one line for a person where it fails."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from threadpoolctl import threadpool_limits

from replay.errors import ReplayDataError
from twin.errors import TwinError


@contextmanager
def fitting(what: str) -> Iterator[None]:
    """Within it linear algebra has one thread (the matrices are small: more only wait for each other), and what
    `twin` or numpy raise becomes a ReplayDataError that begins with `what`."""
    with threadpool_limits(1, user_api="blas"):
        try:
            yield
        except TwinError as error:
            raise ReplayDataError(f"{what}: {error}") from None
        except np.linalg.LinAlgError as error:
            raise ReplayDataError(
                f"{what}: the fit broke off numerically ({error}): check the motor file with "
                "`whyhot motor check`, and leave out the session that is furthest off (`whyhot replay` says which)."
            ) from None
