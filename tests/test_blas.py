"""A solve takes one thread of BLAS, also in a process whose BLAS has several."""

from contextlib import ExitStack

import pytest
import threadpoolctl

from gfmd_cli import solve
from gfmd_cli.grid.blas import one_blas_thread
from gfmd_cli.study import load_search

TABLES = {
    "surface": {"kind": "self-affine", "cutoff": 0.1},
    "elastomer": {"kind": "power", "n": 1},
    "grid": {"points": 64},
    "load": {"p_star": 0.1},
}


@pytest.fixture(autouse=True)
def two_threads():
    with threadpoolctl.threadpool_limits(2, user_api="blas"):
        yield


def blas_threads():
    info = threadpoolctl.threadpool_info()
    return {library["num_threads"] for library in info if library["user_api"] == "blas"}


def test_blas_has_its_threads_again_after_the_last_of_overlapping_solves():
    before = blas_threads()
    with ExitStack() as second:
        with one_blas_thread():
            second.enter_context(one_blas_thread())
        assert blas_threads() == {1}
    assert blas_threads() == before


def test_a_solve_from_python_takes_one_thread(monkeypatch):
    seen = []
    find = load_search.solve_on_grids

    def watched(*arguments):
        seen.append(blas_threads())
        return find(*arguments)

    monkeypatch.setattr(load_search, "solve_on_grids", watched)
    before = blas_threads()
    solve(TABLES)
    assert seen == [{1}]
    assert blas_threads() == before
