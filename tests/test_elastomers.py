"""The stiffness of every elastomer: printed formulae in many digits, limits, tables."""

from itertools import product

import mpmath as mp
import numpy as np
import pytest
from pydantic import TypeAdapter, ValidationError

from gfmd_cli.errors import InputError
from gfmd_cli.physics.elastomers import (
    Elastomer,
    HalfSpace,
    Layer,
    Membrane,
    Plate,
    Power,
    Slab,
    Tabulated,
    slab_factor,
)
from gfmd_cli.physics.persson import Persson, gamma_n, gamma_slab
from gfmd_cli.physics.scenes import build_scene
from gfmd_cli.physics.self_affine import SelfAffine

Q = np.concatenate([[0.0], np.logspace(-6, 6, 61)])
BODIES = [
    *(Power(n=n) for n in (0, 0.25, 0.5, 1, 1.5, 2, 3, 4)),
    HalfSpace(),
    Membrane(),
    Plate(thickness=0.1),
    Slab(thickness=0.01),
    Slab(thickness=10.0),
    Layer(thickness=0.01, poisson=0.2),
    Layer(thickness=10.0, base="sliding"),
]


def name(elastomer):
    return "-".join(str(value) for value in elastomer.model_dump().values())


def printed_slab_factor(t):
    """Paper Eq. (41) as printed, with digits to spare for t^4 terms at t = 1e-8."""
    with mp.workdps(100):
        t = mp.mpf(float(t))
        return (mp.cosh(2 * t) - 2 * t**2 - 1) / (mp.sinh(2 * t) + 2 * t)


def table(path, q, k):
    np.savetxt(path, np.column_stack([q, k]), header="q [1/m]  k [Pa/m]")
    return Tabulated(path=path)


def slab_samples():
    """From 1e-8 to 1e4 evenly in log t, and crowded around the switches of the formula."""
    close = 10.0 ** np.arange(-15, -1, 0.5)
    around = np.concatenate([1 - close, 1 + close, [1.0]])
    return np.concatenate([np.logspace(-8, 4, 401), around, 20 * around, np.linspace(0.8, 25, 200)])


@pytest.mark.parametrize(
    ("elastomer", "short"),
    [
        (Power(n=1.5), "n = 3/2"),
        (Power(n=0.77), "n = 0.77"),
        (HalfSpace(E_star=2e9), "half-space"),
        (Plate(thickness=1e-5), "n = 4"),
        (Slab(thickness=0.01), "t/L = 0.01"),
        (Layer(thickness=1e-5, base="sliding"), "layer thickness=10 µm base=sliding"),
    ],
)
def test_the_short_label_names_what_tells_elastomers_apart(elastomer, short):
    assert elastomer.short_label == short


def test_the_slab_factor_has_all_digits_of_the_printed_formula():
    t = slab_samples()
    exact = [printed_slab_factor(x) for x in t]
    error = [
        float(abs(mp.mpf(float(s)) / e - 1)) for s, e in zip(slab_factor(t), exact, strict=True)
    ]
    assert max(error) < 1e-15  # a few roundings of 1.1e-16


def test_the_slab_factor_ends_in_zero_and_one():
    assert slab_factor(np.array([0.0, 355.0, 1e4, 1e300])).tolist() == [0, 1, 1, 1]


def test_the_slab_factor_rises():
    assert np.all(
        np.diff(slab_factor(np.logspace(-8, 1, 2001))) > 0
    )  # beyond, in steps of rounding


@pytest.mark.parametrize("elastomer", BODIES, ids=name)
def test_the_mean_displacement_meets_no_stiffness(elastomer):
    k = elastomer.stiffness(Q)
    assert k[0] == 0
    assert np.all(k[1:] > 0)
    assert np.all(np.isfinite(k))
    rounding = 1e-14 * k[2:]  # a layer is flat at long waves
    assert np.all(np.diff(k[1:]) >= -rounding)


@pytest.mark.parametrize("n", [0, 0.3, 1, 2.5, 4])
def test_power_laws_are_power_laws(n):
    k = Power(n=n, k_n=3.0).stiffness(Q)
    assert k[1:] == pytest.approx(3.0 * Q[1:] ** n, rel=1e-15, abs=0)


@pytest.mark.parametrize(
    ("elastomer", "power"),
    [
        (HalfSpace(E_star=3.0), Power(n=1, k_n=1.5)),
        (Membrane(tension=3.0), Power(n=2, k_n=3.0)),
        (Plate(E_star=3.0, thickness=0.2), Power(n=4, k_n=0.002)),
    ],
    ids=["half-space", "membrane", "plate"],
)
def test_the_named_elastomers_are_power_laws_of_the_right_prefactor(elastomer, power):
    assert elastomer.stiffness(Q) == pytest.approx(power.stiffness(Q), rel=1e-14, abs=0)
    assert np.array_equal(elastomer.gamma(Q), power.gamma(Q))


def test_a_thin_slab_is_a_plate():
    q, E_star, share, length = np.array([1.0, 7.0]), 3.0, 1e-9, 5.0
    slab = Slab(thickness=share, E_star=E_star).stiffness(q, length)
    plate = Plate(thickness=share * length, E_star=E_star).stiffness(q)
    assert slab == pytest.approx(plate, rel=1e-14, abs=0)  # S = t^3/6 (1 - t^2/5 + ...)


def test_a_slab_departs_from_the_plate_as_its_series_says():
    qt = np.array([0.01, 0.03])
    plate = Plate(thickness=1.0).stiffness(qt)
    series = 1 - qt**2 / 5 + qt**4 / 105 + 4 * qt**6 / 945
    assert Slab(thickness=1.0).stiffness(qt) == pytest.approx(plate * series, rel=1e-14, abs=0)


def test_a_thick_slab_is_a_half_space():
    q = np.array([1.0, 7.0, 1e5])
    slab = Slab(thickness=100.0, E_star=3.0)
    assert np.array_equal(slab.stiffness(q), HalfSpace(E_star=3.0).stiffness(q))
    assert np.array_equal(slab.unit_stiffness(q), HalfSpace(E_star=3.0).stiffness(q))


def test_the_thickness_of_a_slab_is_a_share_of_the_cell():
    slab = Slab(thickness=0.1)
    assert slab.stiffness(Q, 4.0) == pytest.approx(Slab(thickness=0.4).stiffness(Q), rel=1e-14)
    assert slab.gamma(Q, 4.0) == pytest.approx(Slab(thickness=0.4).gamma(Q), rel=1e-14)


def test_gamma_is_that_of_the_exponent():
    tabulated = {0: 0.5, 0.5: 0.45, 1: 0.35, 2: 0.2, 3: 0.1, 4: 0.02}
    for n, gamma in tabulated.items():
        assert Power(n=n).gamma(Q) == pytest.approx(np.full(Q.size, gamma))


def test_gamma_of_a_slab_goes_from_plate_to_half_space():
    slab = Slab(thickness=0.1)
    assert np.array_equal(slab.gamma(Q), gamma_slab(0.1 * Q))
    ends = slab.gamma(np.array([1e-6, 1e6]))
    assert ends == pytest.approx([float(gamma_n(4.0)), float(gamma_n(1.0))], rel=1e-6)


@pytest.mark.parametrize("n", [0, 0.5, 1, 2.3, 4])
def test_a_table_of_a_power_law_is_that_power_law_everywhere(tmp_path, n):
    q = np.array([0.1, 0.5, 1, 30, 100])  # Q goes five and four decades beyond
    elastomer = table(tmp_path / "k.txt", q, 2.0 * q**n)
    assert elastomer.stiffness(Q) == pytest.approx(
        Power(n=n, k_n=2.0).stiffness(Q), rel=1e-12, abs=0
    )
    assert elastomer.gamma(Q[1:]) == pytest.approx(Power(n=n).gamma(Q[1:]), rel=1e-9)


def test_two_rows_make_a_table(tmp_path):
    elastomer = table(tmp_path / "k.txt", [1.0, 10.0], [5.0, 500.0])
    assert elastomer.stiffness(Q) == pytest.approx(
        Power(n=2, k_n=5.0).stiffness(Q), rel=1e-12, abs=0
    )


def test_a_table_of_a_slab_passes_through_its_rows_and_close_in_between(tmp_path):
    slab, q = Slab(thickness=0.1), np.logspace(-1, 4, 101)  # 20 rows a decade
    elastomer = table(tmp_path / "k.txt", q, slab.stiffness(q))
    assert elastomer.stiffness(q) == pytest.approx(slab.stiffness(q), rel=1e-13)
    between = np.sqrt(q[1:] * q[:-1])
    # a cubic through rows log(10)/20 apart, curvature of log k below 2: error (0.115)^3 / 10
    assert elastomer.stiffness(between) == pytest.approx(slab.stiffness(between), rel=2e-4)


def test_gamma_of_a_table_follows_its_local_exponent(tmp_path):
    q = np.array([1e-3, 1e-2, 1e2, 1e3])
    elastomer = table(tmp_path / "k.txt", q, [1e-12, 1e-8, 1e-2, 1e-1])  # n = 4 below, 1 above
    assert elastomer.gamma(np.array([1e-5, 1e5])) == pytest.approx([0.02, 0.35], rel=1e-9)


@pytest.mark.parametrize("n", [0.5, 1, 3.3])
def test_persson_theory_of_a_tabulated_power_law_is_that_of_the_power_law(tmp_path, n):
    surface, p = SelfAffine(cutoff=0.05), np.array([1e-3, 0.1, 2.0])
    elastomer = table(
        tmp_path / "k.txt", np.geomspace(1.0, 300.0, 7), np.geomspace(1.0, 300.0, 7) ** n
    )
    power, tabulated = (build_scene(surface, e, 64) for e in (Power(n=n), elastomer))
    assert tabulated.delta_sigma == pytest.approx(power.delta_sigma, rel=1e-12)
    gaps = [Persson(s.shells).mean_gap(p * s.delta_sigma) for s in (power, tabulated)]
    assert gaps[1] == pytest.approx(gaps[0], rel=1e-9)


def test_persson_theory_of_a_tabulated_slab_has_its_stiffness_and_gamma_between(tmp_path):
    slab, q = Slab(thickness=0.05), np.logspace(0, 3, 301)  # 100 rows a decade
    elastomer = table(tmp_path / "k.txt", q, slab.stiffness(q))
    surface = SelfAffine(cutoff=0.02)
    exact, tabulated = (build_scene(surface, e, 128).shells for e in (slab, elastomer))
    assert tabulated.variance == pytest.approx(exact.variance, rel=1e-5)
    assert tabulated.energy == pytest.approx(exact.energy, rel=1e-5)
    # the exponent from the slope of Eq. (41) itself, in closed steps of 1e-5
    step = 1e-5
    slope = np.log(slab.stiffness(exact.q * (1 + step)) / slab.stiffness(exact.q * (1 - step)))
    expected = gamma_n(slope / (2 * step))
    lone = 64  # shells of one |q|; a bin of several has the mean of theirs
    assert tabulated.gamma[:lone] == pytest.approx(expected[:lone], rel=2e-3)
    assert 0.02 < tabulated.gamma[0] < tabulated.gamma[-1] <= 0.36


def test_the_local_exponent_of_a_slab_goes_from_four_to_one():
    """Small t: k ~ q^4 (1 - t^2/5), exponent 4 - 2 t^2/5; large t: 1."""
    slab = Slab(thickness=1.0)
    t = np.array([1e-3, 0.05, 50.0])
    exponents = slab.local_exponent(t)
    assert exponents[:2] == pytest.approx(4 - 0.4 * t[:2] ** 2, rel=1e-6)
    assert exponents[2] == pytest.approx(1.0, rel=1e-12)


@pytest.mark.parametrize(
    ("content", "complaint"),
    [
        ("1 2\n", "1 rows"),
        ("1 2 3\n2 3 4\n", "3 columns"),
        ("1\n2\n3\n", "1 columns"),
        ("1 1\n1 2\n", "row 2 is 1, 2: .*q must increase"),
        ("2 1\n1 2\n", "q must increase"),
        ("0 1\n1 2\n", "positive"),
        ("1 -1\n2 2\n", "positive"),
        ("1 0\n2 2\n", "positive"),
        ("1 nan\n2 2\n", "finite"),
        ("1 1\n2 inf\n", "row 2 is 2, inf: .*finite"),
        ("q k\n1 2\n2 3\n", "with # before words"),
        ("1,5 2,5\n2,5 3,5\n", "4 columns"),  # decimal commas
        ("1 2\n2\n", "cannot be read"),
        ("1 2\n2 \udcff\n", "cannot be read: not UTF-8 text; the file"),
    ],
)
def test_bad_tables_are_refused(tmp_path, content, complaint):
    path = tmp_path / "bad.txt"
    path.write_text(content, encoding="utf-8", errors="surrogateescape")
    with pytest.raises(InputError, match=complaint) as caught:
        Tabulated(path=path).stiffness(Q)
    assert str(path) in str(caught.value)


@pytest.mark.parametrize("separator", [" ", "\t", ",", ", ", ";"])
def test_columns_of_a_table_are_separated_as_spreadsheets_do(tmp_path, separator):
    lines = ["# q" + separator + "k", *(f"{q}{separator}{2.5 * q}" for q in (1.0, 10.0, 1e3))]
    (tmp_path / "k.csv").write_text("\n".join(lines), encoding="utf-8-sig")
    assert Tabulated(path=tmp_path / "k.csv").stiffness(np.array([7.0])) == pytest.approx(17.5)


@pytest.mark.parametrize("digits", ["%.18e", "%.6g"])
def test_a_rounded_table_is_what_it_was_made_from(tmp_path, digits):
    """The first rows decide about a free boundary, not the rounding of their numbers."""
    q = np.geomspace(1e3, 1e9, 100)
    np.savetxt(tmp_path / "half-space.txt", np.column_stack([q, 5e8 * q]), fmt=digits)
    half_space = Tabulated(path=tmp_path / "half-space.txt")
    assert not half_space.decays(1)
    assert half_space.decays(2)
    assert half_space.uniform_stiffness is None
    layer = Layer(thickness=1e-6, base="bonded", poisson=0.4)
    np.savetxt(tmp_path / "layer.txt", np.column_stack([q, layer.stiffness(q)]), fmt=digits)
    table = Tabulated(path=tmp_path / "layer.txt")
    assert table.decays(1)
    assert table.uniform_stiffness == pytest.approx(layer.uniform_stiffness, rel=1e-3)


def test_a_table_is_read_once_until_its_file_is_replaced(tmp_path, monkeypatch):
    """The grid asks for k(q) block by block of its rows."""
    elastomer = table(tmp_path / "k.txt", Q[1:], Q[1:])
    read, loadtxt = [], np.loadtxt
    monkeypatch.setattr(np, "loadtxt", lambda *a, **keys: read.append(a) or loadtxt(*a, **keys))
    for block in np.array_split(Q, 8):
        assert elastomer.stiffness(block) == pytest.approx(block)
    assert len(read) == 1
    table(tmp_path / "k.txt", Q[2:], 2 * Q[2:])
    assert elastomer.stiffness(Q) == pytest.approx(2 * Q)


def test_unreadable_tables_are_refused(tmp_path):
    (tmp_path / "binary").write_bytes(bytes(range(256)))
    (tmp_path / "folder").mkdir()
    for file in ("missing.txt", "binary", "folder"):
        with pytest.raises(InputError, match=r"elastomer\.path"):
            Tabulated(path=tmp_path / file).stiffness(Q)


def test_an_empty_table_is_refused(tmp_path):
    (tmp_path / "empty.txt").touch()
    with pytest.raises(InputError, match="rows"):
        Tabulated(path=tmp_path / "empty.txt").stiffness(Q)


@pytest.mark.parametrize(
    "keys",
    [
        {"kind": "power", "n": 4.1},
        {"kind": "power", "n": -0.1},
        {"kind": "power", "n": float("nan")},
        {"kind": "power"},
        {"kind": "power", "n": 1, "k_n": 0.0},
        {"kind": "slab", "thickness": 0.0},
        {"kind": "slab"},
        {"kind": "half-space", "E_star": -1.0},
        {"kind": "half-space", "E_star": float("inf")},
        {"kind": "membrane", "E_star": 1.0},
        {"kind": "plate", "thickness": "0.1"},
        {"kind": "jelly"},
    ],
)
def test_elastomers_out_of_range_are_refused(keys):
    with pytest.raises(ValidationError):
        TypeAdapter(Elastomer).validate_python(keys)


@pytest.mark.parametrize(
    ("keys", "stiffness"),
    [
        ({"kind": "power", "n": 1}, "k_n"),
        ({"kind": "half-space"}, "E_star"),
        ({"kind": "membrane"}, "tension"),
        ({"kind": "plate", "thickness": 1e-6}, "E_star"),
        ({"kind": "slab", "thickness": 0.1}, "E_star"),
        ({"kind": "layer", "thickness": 1e-6, "base": "sliding"}, "E_star"),
        ({"kind": "table", "path": "k.txt"}, None),
    ],
)
def test_a_stiffness_given_as_1_is_given(keys, stiffness):
    read = TypeAdapter(Elastomer).validate_python
    assert read(keys).stiffness_given == (stiffness is None)
    if stiffness is not None:
        assert read(keys | {stiffness: 1.0}).stiffness_given


def layered_stiffness(q, thickness, poisson, base):
    """Pressure over displacement of a layer, E = 1, by integration of the equations of elasticity.

    State (U, W, S, T): u_x = U sin qx, u_z = W cos qx, sigma_zz = S cos qx, sigma_xz = T sin qx in
    plane strain. Their derivatives along z follow from Hooke's law and equilibrium; the matrix
    exponential carries the state from the base, W = 0 and U = 0 or T = 0, to the surface, T = 0.
    No coefficient is infinite for nu = 0.5.
    """
    nu = mp.mpf(poisson)
    ratio, compliance = nu / (1 - nu), (1 + nu) * (1 - 2 * nu) / (1 - nu)  # uniaxial strain
    derivative = mp.matrix(
        [
            [0, q, 0, 2 * (1 + nu)],
            [-ratio * q, 0, compliance, 0],
            [0, 0, 0, -q],
            [q**2 / (1 - nu**2), 0, q * ratio, 0],
        ]
    )
    carried = mp.expm(derivative * thickness)
    free = {"bonded": (2, 3), "sliding": (0, 2), "stress": (0, 1)}[base]  # of the state at the base
    system = mp.matrix([[carried[row, column] for column in free] for row in (2, 3)])
    at_base = mp.lu_solve(system, mp.matrix([-1, 0]))
    return -1 / sum(carried[1, column] * at_base[i] for i, column in enumerate(free))


@pytest.mark.parametrize(
    ("base", "poisson"),
    [*product(["bonded", "sliding"], [-0.5, 0.0, 0.3, 0.49, 0.499]), ("sliding", 0.5)],
)
def test_a_layer_is_as_stiff_as_the_equations_of_elasticity_say(base, poisson):
    q, thickness = np.array([1e-4, 0.01, 0.3, 1.0, 3.0, 10.0, 40.0]), 0.7
    layer = Layer(thickness=thickness, E_star=1 / (1 - poisson**2), poisson=poisson, base=base)
    with mp.workdps(50):
        exact = [float(layered_stiffness(mp.mpf(x), thickness, poisson, base)) for x in q]
    assert layer.stiffness(q) == pytest.approx(exact, rel=1e-13, abs=0)
    assert layer.stiffness(np.array([1e-5]))[0] == pytest.approx(layer.uniform_stiffness, rel=1e-8)


def test_a_bonded_layer_is_softer_at_waves_of_its_thickness_if_hardly_compressible():
    """Under a uniform pressure such a layer cannot move aside; under waves it can."""
    soft = Layer(thickness=1.0, poisson=0.45)
    assert soft.stiffness(np.array([1.5]))[0] < 0.5 * soft.uniform_stiffness


def test_a_bonded_layer_needs_poissons_ratio():
    with pytest.raises(ValidationError, match="needs poisson"):
        Layer(thickness=1.0)
    with pytest.raises(ValidationError, match=r"\"sliding\".* less than 0\.5"):
        Layer(thickness=1.0, poisson=0.5)
    with pytest.raises(ValidationError, match=r"less than or equal to 0\.5"):
        Layer(thickness=1.0, poisson=0.6, base="sliding")


def test_a_power_law_of_exponent_1_has_the_modulus_of_its_half_space():
    assert Power(n=1, k_n=3.0).modulus == HalfSpace(E_star=6.0).modulus == 6.0
    assert Power(n=1, k_n=3.0).stiffness(np.ones(1)) == HalfSpace(E_star=6.0).stiffness(np.ones(1))
    assert Power(n=2, k_n=3.0).modulus == 0
