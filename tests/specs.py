"""Texts of run specs that several tests share."""


def power_spec(*, n, points, p_star, cutoff=0.1, more="", name=""):
    """A self-affine surface and the elastomer k ~ q^n; values are TOML, `more` further tables.

    `name` is that of the study.
    """
    study = f'[study]\nname = "{name}"\n' if name else ""
    return f"""\
{study}[surface]
kind = "self-affine"
cutoff = {cutoff}
[elastomer]
kind = "power"
n = {n}
[grid]
points = {points}
[load]
p_star = {p_star}
{more}"""
