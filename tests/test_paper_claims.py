"""The verdicts on the paper follow from measured numbers, and can come out either way."""

import ast
from math import inf, isfinite, nan
from pathlib import Path

import numpy as np
import pytest

SCRIPTS = Path(__file__).parents[1] / "scripts"


@pytest.fixture
def paper(monkeypatch):
    """The modules of the page."""
    pytest.importorskip("matplotlib")
    monkeypatch.syspath_prepend(SCRIPTS)
    from paper import captions, claims, ensembles, page

    modules = {"claims": claims, "page": page, "captions": captions, "ensembles": ensembles}
    return type("Modules", (), modules)


@pytest.mark.parametrize(
    ("value", "error", "holds"),
    [
        (1.0, 0.0, True),
        (1.0, 0.04, True),
        (1.0, 0.06, None),
        (1.2, 0.04, False),
        (1.2, 0.06, None),
        (0.85, 0.0, False),
        (nan, 0.0, None),
        (1.0, nan, None),
    ],
)
def test_a_criterion_allows_for_twice_the_error(paper, value, error, holds):
    criterion = paper.claims.Criterion("x", 0.9, 1.1)
    assert criterion.holds(paper.claims.Value(value, error)) is holds


@pytest.mark.parametrize(
    ("values", "printed", "verdict"),
    [
        ((1.0, 1.0), None, "agrees"),
        ((1.0, 2.0), None, "agrees in part"),
        ((2.0, 2.0), None, "disagrees"),
        ((1.0, nan), None, "not decided here"),
        ((2.0, nan), None, "not decided here"),
        ((1.0, 1.0), 1.0, "agrees"),
        ((1.0, 1.0), 2.0, "misprint"),
        ((1.0, 1.0), nan, "not decided here"),
        ((1.0, 2.0), 2.0, "agrees in part"),
        ((2.0, 2.0), 2.0, "disagrees"),
    ],
)
def test_the_verdict_follows_from_the_criteria(paper, values, printed, verdict):
    claims = paper.claims
    content = claims.Criterion("content", 0.9, 1.1)
    form = claims.Criterion("form", 0.9, 1.1)
    statement = claims.Statement("here", "x", (content,), () if printed is None else (form,))
    measured = {"content": {str(i): claims.Value(v) for i, v in enumerate(values)}}
    if printed is not None:
        measured["form"] = claims.Value(printed)
    assert claims.verdict(statement, claims.Finding("x", measured)) == verdict


def test_what_was_not_measured_is_not_decided(paper):
    claims = paper.claims
    one, other = claims.Criterion("one", high=1.0), claims.Criterion("other", high=1.0)
    statement = claims.Statement("here", "x", (one, other))
    finding = claims.Finding("x", {"one": claims.Value(0.5)})
    assert claims.verdict(statement, finding) == "not decided here"
    assert "other (at most 1): not measured" in claims.result(statement, finding)
    nothing = claims.verdict(claims.Statement("here", "x"), claims.Finding("x", {}))
    assert nothing == "not decided here"


def test_every_statement_can_be_confirmed_and_refuted(paper):
    claims = paper.claims
    for key, statement in paper.page.STATEMENTS.items():
        if not statement.criteria:
            continue
        verdicts = set()
        for side in (0, 1):
            measured = {
                c.quantity: claims.Value(_inside(c) if side == 0 else _outside(c))
                for c in (*statement.criteria, *statement.printed)
            }
            verdicts.add(claims.verdict(statement, claims.Finding(key, measured)))
        assert verdicts == {"agrees", "disagrees"}, key


def _inside(criterion):
    """A value that the criterion allows."""
    limits = [limit for limit in (criterion.low, criterion.high) if isfinite(limit)]
    middle = sum(limits) / len(limits)
    return middle if len(limits) == 2 else middle + (1 if criterion.high == inf else -1)


def _outside(criterion):
    """A value that it does not allow."""
    return criterion.low - 1 if isfinite(criterion.low) else criterion.high + 1


def test_every_figure_of_a_statement_has_a_caption(paper):
    figures = {one.figure for one in paper.page.STATEMENTS.values() if one.figure}
    assert figures <= set(paper.captions.CAPTIONS)


def test_a_quantity_without_a_criterion_is_refused(paper):
    claims = paper.claims
    statement = claims.Statement("here", "x", (claims.Criterion("one", high=1.0),))
    with pytest.raises(ValueError, match="two"):
        claims.verdict(statement, claims.Finding("x", {"two": claims.Value(1.0)}))


def test_every_statement_is_measured_somewhere(paper):
    sources = (path.read_text(encoding="utf-8") for path in (SCRIPTS / "paper").glob("*.py"))
    nodes = (node for text in sources for node in ast.walk(ast.parse(text)))
    calls = [node for node in nodes if isinstance(node, ast.Call)]
    findings = [call for call in calls if ast.unparse(call.func) in ("Finding", "_transfer")]
    words = (word for call in findings for word in call.args if isinstance(word, ast.Constant))
    measured = {word.value for word in words}
    assert set(paper.page.STATEMENTS) <= measured


SEEDS = np.array([[1.0, 8.0], [2.0, 9.0], [4.0, 6.0], [5.0, 5.0]])  # [seed, pressure]


def test_the_jackknife_of_a_mean_is_its_standard_error(paper):
    mean = paper.ensembles.Mean(SEEDS)
    value = paper.ensembles.estimate(lambda y: y[0], mean)
    assert value.value == pytest.approx(3.0)
    assert value.error == pytest.approx(np.std([1, 2, 4, 5], ddof=1) / 2)
    assert mean.error[0] == pytest.approx(value.error)


def test_seeds_that_scatter_together_leave_no_error_in_a_ratio(paper):
    numerator, denominator = (paper.ensembles.Mean(SEEDS[:, :1] * factor) for factor in (3, 1))
    value = paper.ensembles.estimate(lambda a, b: a[0] / b[0], numerator, denominator)
    assert value.value == pytest.approx(3.0)
    assert value.error == pytest.approx(0.0, abs=1e-12)


def test_errors_of_the_grid_add_in_quadrature_and_do_not_shrink_with_seeds(paper):
    grid = np.array([0.3, 0.4])
    mean = paper.ensembles.Mean(np.tile([1.0, 2.0], (16, 1)), grid)
    value = paper.ensembles.estimate(np.sum, mean)
    assert (value.value, value.error) == (pytest.approx(3.0), pytest.approx(0.5))
    assert mean.error == pytest.approx(grid)


def test_a_power_law_is_found_with_its_error(paper):
    x = np.array([1.0, 2.0, 4.0])
    mean = paper.ensembles.Mean(np.outer([1.0, 1.1, 0.9], 5 * x**1.5))
    value = paper.ensembles.power(x, mean)
    assert value.value == pytest.approx(1.5)
    assert value.error == pytest.approx(0.0, abs=1e-9)


def test_one_seed_decides_nothing(paper):
    value = paper.ensembles.estimate(np.sum, paper.ensembles.Mean(SEEDS[:1]))
    assert (value.value, isfinite(value.error)) == (9.0, False)
    assert paper.claims.Criterion("x", low=0.0).holds(value) is None


def test_means_over_different_seeds_are_refused(paper):
    means = [paper.ensembles.Mean(SEEDS[:count]) for count in (3, 4)]
    with pytest.raises(ValueError, match="seeds"):
        paper.ensembles.estimate(lambda a, b: a[0] - b[0], *means)
