"""The page docs/paper.md: the claims, the figures, and where the paper is misprinted."""

from pathlib import Path
from shutil import copyfile

from paper.claims import Claim, count, table

INTRODUCTION = """\
# The paper, claim by claim

M. H. Müser, *Elastic contacts of randomly rough surfaces across the spatial dimensions*, studied again: each of its figures has a
config in `configs/paper/`, and each statement that can be checked stands below with what is found here. Made by

<!-- not run: takes an hour, and minutes -->
```bash
make paper          # all of it: about an hour on two quiet cores
make paper-quick    # small grids, a few minutes; the numbers are then rough
```

Grids are of up to 8192² points (Fig. 5: 4096², the default surface otherwise 1024² to 2048²), where the paper went to 32768².
Random phases differ from the paper's, whose seed is not known, so that single numbers of its one realisation cannot be repeated; trends, exponents,
ratios and exact results can. Values are of the continuum where it is known well, with the error that `[accuracy]` estimates.
"""

THEORY = """\
Whether one smooth γ(n) does (Eq. 39), and what Δσ over the true contact predicts (Sects. 6, 7), is examined in
[Theory beyond the paper](theory.md).
"""

MISPRINTS = """\
## Misprints met on the way

The program is built from the corrected equations. Each was checked against an independent calculation.

| where | printed | should be |
| --- | --- | --- |
| Eqs. 5, 6 | σ = σ(0) √(1 − ρ²)^{2μ}, μ = 2 − n | (1 − ρ²)^{μ/2}: Hertz's law at n = 1, and what is measured (above) |
| Eq. 10b | "for n < 1/2" | for 1/2 < n < 2; I_n = 2^{1−n} Γ(1 − n/2)/Γ(n/2) holds for 0 < n < 2 in the sense of Abel |
| text to Eq. 14 | r₂ = √e a_c, same slope | r₂ = a_c/√e, same height |
| Eq. 15 | u_g²/R_c | a_c²/R_c |
| text to Eq. 17 | coefficient 3/2 at n = 1 | 3/8 for F R/k₁, 3/4 for F R/E* |
| Eq. 18 | a_r = κ′ p R/(k a^{2−n}) | π κ′ p R/(k a^{2−n}) with the printed κ′ |
| text to Eq. 21 | κ_{1/2} "believed exact" | κ′_n = 2^{1−n} Γ(3 − n/2) Γ(2 − n/2)/π; the conjecture is 9.6e-5 off |
| Eq. 24 | two equal exponentials, Δσ² below the line | the second has (σ + p)², below the line stands Δσ |
| Eq. 32 | I | −2 I: F(s) = (p² + s) erf(p/√2s) + p √(2s/π) e^{−p²/2s}, I = F(s₊) − F(s₋) |
| Eq. 33, 38 | δ(h − h_nc); p = k₀ u | δ(u − h_nc); p = k₀ ⟨u⟩ |
| Eq. 40 | Θ(q_s − 1); L/λ_s = 5.12 | Θ(q_s − q); L/λ_r = 5.12 |
| Sect. 2 | q_s/q_r = 1/100; 16k = 2¹⁵ | λ_s/λ_r = 1/100; 16k = 2¹⁴ |
| conclusions | γ(q ≪ 1/t) = γ₁ | γ₄; Eq. 42 has it right |
| Sect. 6 | a_r = erf(p/Δσ_c) | erf(p/√2 Δσ_c) |
| Fig. 13 | λ_r/Δa = 2 … 64 | λ_s/Δa |
"""


def write(claims: list[Claim], figures: Path, target: Path) -> None:
    """The page and its figures (PNG) beside it, in figures/paper."""
    folder = target.parent / "figures" / "paper"
    folder.mkdir(parents=True, exist_ok=True)
    shown = sorted(figures.glob("*.png"))
    for path in shown:
        copyfile(path, folder / path.name)
    gallery = "\n".join(f"![{path.stem}](figures/paper/{path.name})" for path in shown)
    parts = (
        INTRODUCTION,
        f"{count(claims)}.",
        table(claims),
        THEORY,
        MISPRINTS,
        "## Figures",
        gallery,
    )
    target.write_text("\n\n".join(part.strip() for part in parts) + "\n", encoding="utf-8")
