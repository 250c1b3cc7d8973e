from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import gfmd_cli
from gfmd_cli import compare, dataset, rows, run, solve
from gfmd_cli.errors import InputError

TABLES = {
    "surface": {"kind": "self-affine", "cutoff": 0.05, "h_std": 1e-6, "length": 1e-3},
    "elastomer": {"kind": "half-space", "E_star": 2e9},
    "grid": {"points": 64},
    "load": {"pressure": 1e6},
}


def test_a_notebook_gets_the_numbers_of_the_command(tmp_path):
    study = run(TABLES | {"load": {"pressure": [1e6, 3e6]}}, tmp_path / "a.h5")
    first, second = rows(study)
    alone = solve(TABLES)
    for name in ("a_r", "sigma_p", "u_g", "residual", "status"):
        assert getattr(alone, name) == first[name], name
    assert second["pressure"] == pytest.approx(3e6)
    assert dataset(study).a_r.values.tolist() == [first["a_r"], second["a_r"]]


def test_fields_are_those_of_the_contact_problem():
    """sigma >= 0, g >= 0, sigma g = 0; sigma - p = K u with k = E* q / 2, by NumPy."""
    found = solve(TABLES | {"solver": {"tolerance": 1e-9}})
    assert found.stress.mean() == pytest.approx(1e6, rel=1e-9)
    assert found.gap.min() > -1e-16
    assert np.abs(found.stress * found.gap).max() < 1e-6 * found.delta_sigma * found.h_std
    q = 2 * np.pi * np.fft.fftfreq(64, 1e-3 / 64)
    elastic = np.fft.ifft2(1e9 * np.hypot(q[:, None], q) * np.fft.fft2(found.displacement)).real
    np.testing.assert_allclose(found.stress, elastic + 1e6, atol=1e-6 * found.delta_sigma)
    assert found.p_star == pytest.approx(1e6 / found.delta_sigma)
    assert found.contact.mean() == found.a_r
    assert found.gap.mean() == pytest.approx(found.u_g * found.h_std, rel=1e-6)


def test_an_array_may_be_pressed():
    """The same heights as those of the surface."""
    alone = solve(TABLES)
    tables = {name: TABLES[name] for name in ("elastomer", "grid", "load")}
    again = solve(tables | {"surface": {"length": 1e-3}}, heights=alone.height)
    assert again.a_r == alone.a_r
    np.testing.assert_allclose(again.stress, alone.stress, atol=1e-5 * alone.delta_sigma)
    with pytest.raises(InputError, match="heights go with a dictionary"):
        solve("a.toml", heights=alone.height)


def test_theory_stands_beside_a_study(tmp_path):
    (curve,) = compare(run(TABLES, tmp_path / "a.h5")).curves
    assert curve.prediction.a_r == pytest.approx(curve.persson.contact_area(1e6))


def test_a_spec_in_a_file_takes_overrides(tmp_path):
    (tmp_path / "a.toml").write_text(
        '[surface]\nkind = "wave"\n[elastomer]\nkind = "half-space"\n'
        "[grid]\npoints = 64\n[load]\np_star = 1\n"
    )
    study = run(tmp_path / "a.toml", tmp_path / "a.h5", overrides=("load.p_star=0.5",))
    assert [row["p_star"] for row in rows(study)] == [0.5]


def test_what_makes_no_sense_is_refused(tmp_path):
    with pytest.raises(InputError, match="the spec has 2; run"):
        solve(TABLES | {"load": {"p_star": [0.1, 1]}})
    with pytest.raises(InputError, match=r"spec: surface.hursts: unknown key 'hursts' - did you"):
        solve(TABLES | {"surface": {"kind": "self-affine", "hursts": 1}})
    with pytest.raises(InputError, match="overrides go with a spec in a file"):
        run(TABLES, tmp_path / "a.h5", overrides=("load.p_star=0.5",))
    with pytest.raises(AttributeError, match="no attribute 'walk'"):
        _ = gfmd_cli.walk


def test_a_study_may_be_run_in_a_thread(tmp_path):
    with ThreadPoolExecutor(1) as pool:
        study = pool.submit(run, TABLES, tmp_path / "a.h5").result()
    assert rows(study)[0]["status"] == "converged"
