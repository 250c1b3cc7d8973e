"""Statements on single contacts (Sects. 2.1 and 3), with their criteria."""

from math import pi, sqrt

from paper.claims import Criterion, Statement

KAPPA_0, KAPPA_1 = 2 / sqrt(3), 3 * pi / (8 * sqrt(2))

HERTZ = {
    "skin": Statement(
        "Fig. 1",
        "The profile of human skin on a periodic ridge is that of n = 2.",
        figure="fig01",
    ),
    "pointed": Statement(
        "Sect. 2.1, Fig. 1",
        "Compared with n = 2, the profile for n = 3 is too pointed near the minima and too blunt near "
        "the maxima; for n = 1 it is the other way round.",
        (
            Criterion("curvature at the minimum in depths per period², n = 3 over n = 2", low=1.05),
            Criterion("the same, n = 1 over n = 2", high=0.95),
            Criterion("width of the maximum at 3/4 of the depth, n = 3 over n = 2", low=1.05),
            Criterion("the same width, n = 1 over n = 2", high=0.95),
        ),
        figure="fig01",
    ),
    "stiffness_alone": Statement(
        "Sect. 2.1",
        "For so small a contact the stiffness alone determines the profile outside of it.",
        (
            Criterion(
                "largest difference from a line force beyond 1.5 contact half-widths, in depths",
                high=0.02,
            ),
        ),
        figure="fig01",
    ),
    "stratum": Statement(
        "Sect. 2.1",
        "The period of 2.5 mm is well below the O(10 µm) of the stratum corneum.",
        (Criterion("larger of both lengths over the smaller", low=10.0),),
        (Criterion("period over thickness", high=0.1),),
    ),
    "profile": Statement(
        "Eqs. (5), (6), Fig. 2",
        "σ = σ(0) √(1 − r²/a²)^(2μ) with μ = 2 − n; elsewhere (Sect. 5) σ ∝ d^(μ/2).",
        (Criterion("exponent of 1 − r²/a² over μ/2", 0.95, 1.05),),
        (Criterion("the same exponent over μ", 0.95, 1.05),),
        figure="fig02",
    ),
    "plate_stress": Statement(
        "Sect. 3, n = 4",
        "Stress is concentrated within the contact line; stress and displacement (read: gap) disappear "
        "for r < a.",
        (
            Criterion("share of the load on the line", low=0.9),
            Criterion("largest gap for r < 0.9 a, in a²/R", high=1e-3),
            Criterion("mean stress for r < 0.6 a over the pressure", high=0.1),
        ),
        figure="fig02",
    ),
    "point_force": Statement(
        "Sect. 3, Fig. 3",
        "A point force mimics the true displacement up to the proximity of the contact.",
        (
            Criterion(
                "difference at r = 2 a in a²/R, heights matched at the corner of the cell",
                high=0.05,
            ),
        ),
        figure="fig03",
    ),
    "springs": Statement(
        "Sect. 3.1.1",
        "n = 0: outside, the displacement is the height of the indenter at the contact line.",
        (
            Criterion("depth below the top in a²/2R", 0.999, 1.001),
            Criterion("its variation outside, in a²/R", high=1e-3),
        ),
        figure="fig03",
    ),
    "membrane": Statement(
        "Sect. 3.1.4, Eq. (14)",
        "n = 2: outside, u = (F/2πk) ln(r/r₂) with r₂ = √e a.",
        (Criterion("variation of the fitted r₂ for r = 1.1 a to 2 a, in a", high=0.01),),
        (Criterion("r₂/a over √e", 0.99, 1.01),),
        figure="fig03",
    ),
    "leading_wave": Statement(
        "Sect. 3.1.5",
        "n = 4: the leading Fourier summand is almost sufficient outside the contact.",
        (Criterion("rms deviation of this term outside the contact, in depths", high=0.1),),
        figure="fig03",
    ),
    "gap_law": Statement(
        "Sect. 3",
        "Just outside the contact the gap grows as (r − a)^(1 + n/2).",
        (Criterion("fitted exponent over 1 + n/2", 0.95, 1.05),),
        figure="fig03b",
    ),
    "slope_jump": Statement(
        "Sect. 6, item 4",
        "For n < 1 the slope of the displacement is discontinuous at the contact edge.",
        (Criterion("exponent of the gap (1: a jump of the slope)", 0.95, 1.05),),
        figure="fig03b",
    ),
    "eq18": Statement(
        "Eq. (18), Sect. 3.3",
        "a_r = κ′ p R / (k a^(2−n)), with κ₀, κ₁ as given and κ′ = 0.665(5) at n = 1/2.",
        (Criterion("k a^(4−n)/(F R) over the κ′ that the paper gives", 0.99, 1.01),),
        (Criterion("a_r k a^(2−n)/(p R) over the κ′ that the paper gives", 0.99, 1.01),),
        figure="kappa",
    ),
    "kappa_exact": Statement(
        "Sect. 3.3",
        "κ₀ = 2/√3 and κ₁ = 3π/(8√2).",
        (
            Criterion("κ₀ from the solved contacts", 0.999 * KAPPA_0, 1.001 * KAPPA_0),
            Criterion("κ₁ from the solved contacts", 0.999 * KAPPA_1, 1.001 * KAPPA_1),
        ),
        figure="kappa",
    ),
    "eq17": Statement(
        "Eq. (17)",
        "n = 1: a³ = c F R / k₁, the regular Hertz law (c = 3/4 with E*), with c = 3/2.",
        (Criterion("a³ E*/(F R) over 3/4", 0.99, 1.01),),
        (Criterion("a³ k₁/(F R) over 3/2", 0.99, 1.01),),
    ),
    "kappa_persson": Statement(
        "Sect. 4.1.2",
        "κ_P = √(2/π) = 0.798 is in reasonable agreement with κ_n for 0 < n < 1.",
        (Criterion("κ_n/κ_P (20 % is the error that Sect. 1 calls problematic)", 0.8, 1.2),),
        figure="kappa",
    ),
    "kappa_half": Statement(
        "Sect. 3.3",
        "n = 1/2: κ′ = 0.665(5) numerically; (2/3)² (8π/5)^(1/4) = 0.665480 is believed exact.",
        (
            Criterion("κ′ of the solved contacts", 0.660, 0.670),
            Criterion("(conjecture over exact integral − 1) · 10⁴", -0.1, 0.1),
        ),
        figure="kappa",
    ),
    "radius_law": Statement(
        "Eq. (17)",
        "a^(4−n) is proportional to F R / k.",
        (Criterion("d ln F/d ln a over 4 − n, corrected for the images", 0.97, 1.03),),
    ),
    "radius_limit": Statement(
        "Sect. 3",
        "At fixed load a_c has a limit for large L for n < 3, or even n ≤ 3; for n = 4 it grows with L.",
        (
            Criterion("d ln a/d ln L at a = 0.01 L over that at 0.1 L, n ≤ 3", high=0.5),
            Criterion("d ln a/d ln L for n = 4", low=0.95),
        ),
    ),
    "far_field": Statement(
        "Sect. 3.2 (ii)",
        "u(r) ∝ r^(n−2) far away for 1/2 ≤ n < 2.",
        (Criterion("fitted power of r over n − 2", 0.98, 1.02),),
    ),
    "far_field_quarter": Statement(
        "Sect. 3.2 (ii)",
        "n = 1/4: u ∝ r^(−2.25), faster than r^(n−2).",
        (Criterion("fitted power of r", -2.35, -2.15),),
    ),
    "amplitude": Statement(
        "Eqs. (10), (11)",
        "I(1/2) = 0.478(0).",
        (Criterion("amplitude of the far field", 0.4775, 0.4785),),
    ),
    "depth": Statement(
        "Sects. 3.1.3, 3.3",
        "n = 1: d = a²/R; for n < 2 the depth scales as a²/R.",
        (Criterion("d (2 − n) R/a², corrected for the images", 0.98, 1.02),),
    ),
    "depth_size": Statement(
        "Sect. 3.2 (i)",
        "The depth at fixed force stays finite with L for n < 2, grows as ln L for n = 2 and "
        "algebraically for n > 2.",
        (
            Criterion("growth of the depth from L to 2 L over that from L/2 to L, n < 2", high=0.9),
            Criterion("the same for n = 2", 0.9, 1.1),
            Criterion("the same for n > 2 (point force)", low=1.1),
        ),
    ),
    "period": Statement(
        "Sect. 3.2 (iii)",
        "For n > 2 the prefactor of the derivative of u depends on the period even for L ≫ a.",
        (
            Criterion(
                "change of u′(r) if L doubles, at L = 1000 r over that at L = 100 r (1 if the "
                "dependence stays)",
                low=0.5,
            ),
        ),
    ),
    "volume": Statement(
        "Sect. 3.2 (iv)",
        "The displaced volume stays finite for n below a critical 0.25 < n < 0.5.",
        (Criterion("power of L of the volume at n = 0.25", high=0.05),),
    ),
}
