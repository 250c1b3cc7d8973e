"""Sizes of grids in words."""

import pytest

from gfmd_cli.analysis.wording import grid_size


@pytest.mark.parametrize(
    ("sizes", "text"),
    [
        ([(256, 256)], "256 points a side"),
        ([(256, 256), (64, 64), (256, 256)], "64 to 256 points a side"),
        ([(256, 128)], "256 x 128 points"),
        ([(128, 64), (64, 32)], "64 x 32 to 128 x 64 points"),
        ([(1024, 1)], "1024 points"),
        ([(1024, 1), (512, 1)], "512 to 1024 points"),
        ([(128, 64), (64, 1)], "64 points (line contacts), 128 x 64 points (surfaces)"),
    ],
)
def test_grids_are_named_by_their_points(sizes, text):
    assert grid_size([{"points": x, "points_y": y} for x, y in sizes]) == text
