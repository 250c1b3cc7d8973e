"""A first run spec: complete, commented, and small enough to run in seconds."""

import json
from collections.abc import Sequence
from math import log10
from os.path import relpath
from pathlib import Path

from gfmd_cli.errors import InputError
from gfmd_cli.physics.contact import build_scene
from gfmd_cli.physics.elastomer import HalfSpace
from gfmd_cli.physics.surface import FileSurface
from gfmd_cli.physics.topography import read_topography

SCHEMA = Path(__file__).parent.parent / "run-spec.schema.json"
"""The JSON Schema of the run spec, as it is shipped for editors."""
E_STAR = 2e9  # Pa, of a stiff polymer: what a first run is pressed on
POINTS = 256  # per side: seconds
COMMENT = 28  # column at which comments begin

Line = tuple[str, object, str]
"""Key, value, comment. A key that begins with # is commented out."""

ROUGHNESS: list[Line] = [
    ("kind", "self-affine", 'random; "file" takes a measured map: gfmd init --from SCAN'),
    ("hurst", 0.8, "Hurst exponent H"),
    ("rolloff", 0.5, "lambda_r / L"),
    ("cutoff", 0.02, "lambda_s / L"),
    ("seed", [0, 1], "a list makes a sweep; sweeps multiply"),
    ("#length", 1e-3, "side of the cell L [m]"),
    ("#h_std", 1e-6, "rms height [m]"),
]
BODIES: list[Line] = [
    ("kind", "power", "k(q) = k_n q^n; also slab, table, half-space, membrane, plate"),
    ("n", [1, 2], "any from 0 (springs) over 1 (half-space) to 4 (plate)"),
]
LOADS: list[Line] = [
    ("p_star", [0.03, 0.1, 0.3], "p / Delta_sigma; or { from = 1e-3, to = 1, per_decade = 2 }"),
    ("#pressure", [1e5, 1e6], "[Pa], in its place"),
    ("#contact_area", 0.1, "a_r, or mean_gap (u_g / h_std): their pressure is searched"),
]
SAID = {"dataset", "periodic", "taper", "scale", "length"}
"""Keys of a scan that are written as they were given."""
FURTHER: list[Line] = [
    ("#scale", 1e-9, "from the heights of the file to metres; here nm"),
    ("#length", 1e-5, "side [m]"),
    ("#periodic", False, "false: levelled, its edges made to meet"),
    ("#taper", 0.1, "of the side, that a window fades"),
]
OPTIONS: dict[str, list[Line]] = {
    "#accuracy": [
        ("#mean_gap", 0.01, "errors that you accept, relative to the continuum value:"),
        ("#contact_area", 0.05, "numbers come with error bars"),
    ],
    "#solver": [
        ("#tolerance", 1e-6, "natural residual"),
        ("#max_steps", 20000, "then the status says so, and the exit status is 1"),
    ],
}


def starter(name: str) -> str:
    """A spec of random roughness, to be written as the file `name`."""
    return _spec(
        name,
        "Random roughness pressed on elastic bodies.",
        {
            "surface": ROUGHNESS,
            "elastomer": BODIES,
            "grid": [("points", POINTS, 'per side, even; "auto" together with [accuracy]')],
            "load": LOADS,
        },
        [],
    )


def starter_of_scan(path: Path, given: FileSurface) -> tuple[str, list[str]]:
    """A spec that presses a measured surface, to be written as `path`, and what looks wrong.

    A map that is not square is cropped and holes are filled, both said in the spec; the pressures
    run from p* = 0.003 to 0.3. Raises InputError where the scan is unfit.
    """
    surface = _fitting(given)
    scan, remarks = surface.path, surface.remarks()
    points = surface.smallest_grid()
    scene = build_scene(surface, HalfSpace(E_star=E_STAR), points)
    levelling, edges = surface.treatment()
    needed: list[Line] = []
    if surface.crop:
        needed.append(("crop", True, "the map is not square: its middle is taken"))
    if surface.missing == "fill":
        needed.append(("missing", "fill", "the map has holes"))
    unit = scene.delta_sigma
    low, high = (10.0 ** round(log10(p_star * unit)) for p_star in (0.003, 0.3))
    said = surface.model_dump(include=SAID, exclude_unset=True)
    text = _spec(
        path.name,
        f"{scan.name} pressed on an elastic half-space: L = {scene.grid.length:.4g} m, "
        f"rms height {scene.h_std:.3g} m.",
        {
            "surface": [
                ("kind", "file", "a measured map: .npy, HDF5, or what microscopes write"),
                ("path", relpath(scan, path.parent), "relative to this file"),
                *((key, value, "as asked for") for key, value in said.items()),
                *needed,
                ("level", levelling, "to take off: none, mean, plane, curvature"),
                ("edges", edges, "made to meet by: window, mirror, none"),
                *((key, value, why) for key, value, why in FURTHER if key[1:] not in said),
            ],
            "elastomer": [
                ("kind", "half-space", "also membrane, plate, slab, power, table"),
                ("E_star", E_STAR, "E / (1 - nu^2) [Pa]: YOUR MATERIAL HERE"),
            ],
            "grid": [("points", points, "per side; that of the map, or more: interpolated")],
            "load": [
                (
                    "pressure",
                    {"from": low, "to": high, "per_decade": 2},
                    f"[Pa]; p* = 1 is {unit:.3g} Pa",
                ),
                ("#p_star", [0.01, 0.1], "p / Delta_sigma, in its place"),
            ],
        },
        ["u", "sigma", "height"],
        remarks,
    )
    return text, remarks


def _fitting(given: FileSurface) -> FileSurface:
    """The surface, cropped and filled only where it has to be. Raises InputError."""
    refused = []
    for crop in (given.crop, True):
        for missing in (given.missing, "fill"):
            try:
                read_topography(given.path, given.dataset, crop=crop, fill=missing == "fill")
            except InputError as error:
                refused.append(error)
                continue
            return given.model_copy(update={"crop": crop, "missing": missing})
    raise refused[0]


def _spec(
    name: str,
    title: str,
    tables: dict[str, list[Line]],
    fields: list[str],
    remarks: Sequence[str] = (),
) -> str:
    """The text of a spec from its tables."""
    output: list[Line] = [
        ("fields", fields, 'any of "u", "sigma", "height": maps, for report and export'),
        ("cross_section", True, "height, displacement and stress along the diagonal"),
    ]
    whole: dict[str, list[Line]] = {
        "study": [("name", Path(name).stem, "the study is NAME.h5")],
        **tables,
        **OPTIONS,
        "output": output,
    }
    lines = [
        f"#:schema {SCHEMA}",
        f"# {title}",
        f"# Keys that are commented out show an example. Run it: gfmd run {name}",
        *(f"# NOTE: {remark}" for remark in remarks),
    ]
    for table, keys in whole.items():
        lines += ["", f"#[{table[1:]}]" if table.startswith("#") else f"[{table}]"]
        lines += [
            f"{key} = {_toml(value)}".ljust(COMMENT - 1) + f" # {why}" for key, value, why in keys
        ]
    return "\n".join(lines) + "\n"


def _toml(value: object) -> str:
    """A value as TOML."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {_toml(inner)}" for key, inner in value.items()) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(map(_toml, value)) + "]"
    if isinstance(value, float) and (value >= 1e4 or value < 1e-3):
        return f"{value:.0e}".replace("e+0", "e").replace("e-0", "e-")
    return json.dumps(value)
