import os

# One thread for BLAS: side by side with other workers its threads spin for longer than they work.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from pathlib import Path

import pytest
from click.testing import CliRunner

from gfmd_cli.cli import main
from gfmd_cli.study.parse import read_spec
from gfmd_cli.study.reading import read_rows
from gfmd_cli.study.run import run_study


@pytest.fixture
def spec_of(tmp_path, request):
    """The spec of a text, by default SPEC of the test's module, with overrides."""

    def spec_of(*overrides, text=None):
        path = tmp_path / "spec.toml"
        path.write_text(text or request.module.SPEC)
        return read_spec(path, overrides)[0]

    return spec_of


@pytest.fixture
def rows_of(tmp_path, spec_of, request):
    """The rows of such a spec, solved."""

    def rows_of(*overrides, text=None, name="study.h5", report=lambda progress: None):
        spec = spec_of(*overrides, text=text)
        run_study(spec, text or request.module.SPEC, tmp_path / name, report, jobs=1)
        return read_rows(tmp_path / name)

    return rows_of


@pytest.fixture
def gfmd(tmp_path, monkeypatch, request):
    """Calls the command in tmp_path, where spec.toml is SPEC of the test's module."""
    monkeypatch.chdir(tmp_path)
    Path("spec.toml").write_text(request.module.SPEC)
    return lambda *words: CliRunner().invoke(main, [str(word) for word in words])
