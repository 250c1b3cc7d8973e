"""Texts of run specs that several tests share."""


def power_spec(*, n, points, p_star, cutoff=0.1, more=""):
    """A self-affine surface and the elastomer k ~ q^n; values are TOML, `more` further tables."""
    return f"""\
[surface]
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
