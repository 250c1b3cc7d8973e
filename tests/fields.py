"""Comparison of whole fields, which `pytest.approx` would take element by element."""

import numpy as np


def assert_close(field, expected, tolerance):
    """That no element differs by more than an absolute tolerance, and none is NaN."""
    np.testing.assert_allclose(field, expected, rtol=0, atol=tolerance, equal_nan=False)
