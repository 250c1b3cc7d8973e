"""`gfmd init` and `gfmd surface`: from a scan to a spec."""

from pathlib import Path

import click

from gfmd_cli.cli.options import FILE, overrides_option
from gfmd_cli.errors import InputError


@click.command()
@click.argument("spec", type=FILE, default="study.toml")
@click.option("--from", "scan", type=FILE, metavar="SCAN", help="A measured height map to press.")
@overrides_option
def init(spec: Path, scan: Path | None, overrides: tuple[str, ...]) -> None:
    """Write a commented run spec that runs in seconds, to begin with.

    With --from, it presses a measured surface: a .npy or HDF5 array, or a microscope file; --set
    says more about it. Examples:

    \b
        gfmd init contact.toml --from scan.di
        gfmd init contact.toml --from nm.npy --set surface.scale=1e-9 --set surface.length=1e-5
    """
    from gfmd_cli.study.files import write_whole
    from gfmd_cli.study.parse import read_scan
    from gfmd_cli.study.starter import starter, starter_of_scan

    if spec.exists():
        raise InputError(f"{spec}: exists already; take another name, or remove it")
    if scan is None and overrides:
        raise InputError("--set goes with --from here; what is written can be changed")
    if scan is None:
        text = starter(spec.name)
    else:
        given = read_scan(scan, overrides)
        text, remarks = starter_of_scan(spec, given)
        for remark in remarks:
            click.echo(f"gfmd: {scan}: {remark}", err=True)
    write_whole(spec, text.encode())
    click.echo(f"{spec}: written, look through it\nnext: gfmd run {spec}")


@click.command()
@click.argument("path", metavar="SPEC|SCAN", type=FILE)
@overrides_option
def surface(path: Path, overrides: tuple[str, ...]) -> None:
    """Say what a surface is: size, rms height, gradient, curvature, and its spectrum.

    The power spectrum is fitted by that of a self-affine surface, which is printed as a table
    [surface] to run. A scan is levelled and made periodic as a spec with its defaults does it.
    Examples:

    \b
        gfmd surface scan.di
        gfmd surface nm.npy --set surface.scale=1e-9 --set surface.periodic=false
    """
    from gfmd_cli.analysis.roughness import roughness
    from gfmd_cli.study.parse import read_scan, read_spec

    if path.suffix == ".toml":
        surfaces = list(read_spec(path, overrides)[0].surface)
    else:
        surfaces = [read_scan(path, overrides)]
    click.echo("\n\n".join(map(roughness, surfaces)))
