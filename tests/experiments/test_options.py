from __future__ import annotations

import numpy as np
import pytest

from stiffdice.errors import InputError
from stiffdice.experiments import options


@pytest.mark.parametrize("ends", [(0.0, 1.0), (1.0, 1.0), (0.5, 2.0), (0.005, 1.0), (0.5,), (0.1, np.nan)])
def test_a_span_has_two_ends_in_its_bounds(ends):
    with pytest.raises(InputError, match="omega_h"):
        options.span(ends, 0.01, 2.0)
    assert options.span((0.01, 1.99), 0.01, 2.0) == (0.01, 1.99)


def test_a_scan_has_its_ends_exactly_and_what_is_special_once():
    scan = options.scan(0.1, 1.0, 7, [0.05, 0.1, 0.37, 1.0, 1.2])
    assert (scan[0], scan[-1], len(scan)) == (0.1, 1.0, 8)
    assert 0.37 in scan
    assert (np.diff(scan) > 0).all()
