"""`gfmd init` and `gfmd surface`: from a scan to a spec."""

from pathlib import Path

import click

from gfmd_cli.cli.options import FILE, overrides_option
from gfmd_cli.errors import InputError


@click.command()
@click.argument("spec", type=FILE, default="study.toml")
@click.option("--from", "scan", type=FILE, metavar="SCAN", help="A measured height map to press.")
def init(spec: Path, scan: Path | None) -> None:
    """Write a commented run spec that runs in seconds, to begin with.

    With --from, it presses a measured surface: a .npy or HDF5 array, or a microscope file. Example:

        gfmd init contact.toml --from scan.di
    """
    from gfmd_cli.study.files import write_whole
    from gfmd_cli.study.starter import starter, starter_of_scan

    if spec.exists():
        raise InputError(f"{spec}: exists already; take another name, or remove it")
    text = starter(spec.name) if scan is None else starter_of_scan(spec, scan)
    write_whole(spec, text.encode())
    click.echo(f"{spec}: written, look through it\nnext: gfmd run {spec}")


@click.command()
@click.argument("path", metavar="SPEC|SCAN", type=FILE)
@overrides_option
def surface(path: Path, overrides: tuple[str, ...]) -> None:
    """Say what a surface is: size, rms height, gradient, curvature, and its spectrum.

    The power spectrum is fitted by that of a self-affine surface, which is printed as a table
    [surface] to run. A scan is levelled and made periodic as a spec with its defaults does it.
    Example:

        gfmd surface scan.di
    """
    from gfmd_cli.analysis.roughness import roughness
    from gfmd_cli.physics.surface import FileSurface
    from gfmd_cli.study.parse import read_spec

    if path.suffix == ".toml":
        surfaces = list(read_spec(path, overrides)[0].surface)
    elif overrides:
        raise InputError(f"--set goes with a spec; {path} is none")
    else:
        surfaces = [FileSurface(path=path)]
    click.echo("\n\n".join(map(roughness, surfaces)))
