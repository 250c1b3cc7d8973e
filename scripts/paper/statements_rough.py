"""Statements on rough contacts (abstract and Sects. 5 to 7), with their criteria."""

from paper.claims import Criterion, Statement

ROUGH = {
    "spread": Statement(
        "Fig. 4, Sect. 5",
        "At a_r = 0.10 the contact spreads out as n rises: few places for n = 0, almost uniform for "
        "n ≥ 2.",
        (
            Criterion("longest stretch of the diagonal without contact in L, n = 0", low=0.5),
            Criterion("the same stretch for n ≥ 2", high=0.25),
            Criterion("contacts along the diagonal, n = 3 over n = 0", low=3.0),
        ),
        figure="fig04",
    ),
    "asperity": Statement(
        "Fig. 5, Sect. 5",
        "In one asperity the n = 1/2 elastomer makes almost perfect contact, the n = 3 elastomer close to its "
        "usual 10 %.",
        (
            Criterion("share in contact at n = 1/2", low=0.9),
            Criterion("share in contact at n = 3", 0.05, 0.2),
        ),
        figure="fig05",
    ),
    "linear": Statement(
        "Fig. 6, Sect. 5.1",
        "At small p* a_r is proportional to p* up to logarithms for 1/2 ≤ n ≤ 2.",
        (Criterion("d ln a_r/d ln p* for p* ≤ 0.035", 0.85, 1.15),),
        figure="fig06a",
    ),
    "other_power": Statement(
        "Fig. 6, Sect. 5.1",
        "At small p* an entirely different power than a_r ∝ p* is observed for n = 3.",
        (Criterion("d ln a_r/d ln p* in the continuum, p* ≤ 0.16", low=1.2),),
        figure="light_area",
    ),
    "full_contact": Statement(
        "Fig. 6, Sect. 5.1",
        "Persson theory predicts the deviations from full contact at large p* reasonably well for all "
        "elastomers.",
        (Criterion("largest error of a_r for p* ≥ 1 (reasonable: 20 %, as in Sect. 1)", high=0.2),),
        figure="fig06b",
    ),
    "small_stress": Statement(
        "Fig. 7, Sect. 5.1",
        "Pr(σ → 0) ∝ σ^μ with μ = 0.3 (n = 1/2) and 0.6 (n = 1), each ± 0.1, where theory has 1 for all.",
        (
            Criterion("n/(2 − n), law of the contact edge, less the μ of the paper", -0.2, 0.2),
            Criterion("exponent in the lowest resolved half decade, n = 1/2", 0.1, 0.5),
        ),
        figure="fig07",
    ),
    "small_stress_bulk": Statement(
        "Fig. 7, Sect. 5.1",
        "The exponent μ changes continuously with n, whereas theory has 1 for all n.",
        (Criterion("exponent in the lowest resolved half decade, n = 1 less n = 1/2", low=0.1),),
        figure="fig07",
    ),
    "tail": Statement(
        "Figs. 7 and 13, Sects. 5.1 and 6",
        "n = 3: the tail of Pr(σ) falls as σ^−2.5 (Sect. 5.1), as σ^−2.6 ± 0.15 (Sect. 6), instead of a "
        "Gaussian.",
        (
            Criterion("exponent for σ = 4 to 12 Δσ on the finest grid", -2.9, -2.3),
            Criterion("exponent of the law of the contact edge", -2.9, -2.3),
        ),
        figure="fig13",
    ),
    "divergence": Statement(
        "Fig. 8, Sect. 5.1",
        "n = 3: σ_p diverges; it grows quasi-logarithmically with the number of points, even close to "
        "full contact.",
        (
            Criterion("increments of σ_p² of two successive doublings, their ratio", 0.8, 1.25),
            Criterion("growth of σ_p² at the last doubling, in Δσ²", low=0.02),
        ),
        figure="light_deviation",
    ),
    "rise": Statement(
        "Fig. 8, Sect. 5.1",
        "n = 3 is the only case in which σ_p increases with decreasing pressure.",
        (
            Criterion("largest σ_p/Δσ over p* on the finest grid, n = 3", low=1.02),
            Criterion("largest σ_p/Δσ over p*, n ≤ 2", high=1.005),
        ),
        figure="light_deviation",
    ),
    "quasi_logarithmic": Statement(
        "Abstract, Fig. 9a",
        "At small p the gap falls quasi-logarithmically with p for every n.",
        (
            Criterion(
                "fall of u_g over one decade of p* over that of the decade above, below the pressure "
                "at which the long waves are in contact",
                0.6,
                1.6,
            ),
        ),
        figure="small_pressure",
    ),
    "exponential": Statement(
        "Abstract, Fig. 9b",
        "At large p the gap decays exponentially with p for every n.",
        (
            Criterion("d ln u_g/d p* at p* = 1.75 over that at 1.25", 0.85, 1.15),
            Criterion("d ln u_g/d p* at p* = 2.75 over that at 1.25", 0.85, 1.15),
        ),
        figure="fig09b",
    ),
    "accuracy": Statement(
        "Fig. 9, Sect. 5.2",
        "With γ of Eq. 39 the errors are for the most part within close to 10 % in u_g (p* ≤ 1) and 20 % "
        "in p at equal u_g (p* ≥ 1), for 1/2 ≤ n ≤ 4.",
        (
            Criterion("median error of u_g, p* ≤ 1", high=0.11),
            Criterion("median error of p, p* ≥ 1", high=0.2),
        ),
        figure="fig09a",
    ),
    "twenty_percent": Statement(
        "Conclusions",
        "For 1/2 ≤ n ≤ 3 the errors of u_g(p) at small p and of p(u_g) at small u_g stay below 20 %.",
        (
            Criterion("largest error of u_g, p* ≤ 0.5", high=0.2),
            Criterion("largest error of p, p* ≥ 1", high=0.2),
        ),
        figure="fig09a",
    ),
    "hurst": Statement(
        "Fig. 10, Sect. 5.2.1",
        "With H = 0.3 instead of 0.8 the quality of the prediction does not deteriorate.",
        (
            Criterion("median error of u_g over all n, H = 0.3 over H = 0.8", high=1.25),
            Criterion("largest error of u_g over all n, H = 0.3 over H = 0.8", high=1.25),
        ),
        figure="fig10a",
    ),
    "cut_off": Statement(
        "Sect. 5.2.1",
        "With a cut-off instead of a roll-off spectrum the results are positive (not shown in the paper).",
        (
            Criterion("median error of u_g over all n, cut-off over roll-off", high=1.25),
            Criterion("largest error of u_g over all n, cut-off over roll-off", high=1.25),
        ),
        figure="cut_off",
    ),
    "spacing": Statement(
        "Sect. 5.2.1",
        "At Δa = λₛ/2 the mean gap is within one per cent of the continuum.",
        (Criterion("distance of u_g from the continuum", high=0.01),),
    ),
    "slab": Statement(
        "Fig. 11, Sect. 5.2.1, Eq. 42",
        "For slabs the theory with γ(qt) is at least semi-quantitative, but less convincing than "
        "elsewhere.",
        (
            Criterion("largest error of u_g, p* ≤ 1 (semi-quantitative: 30 %)", high=0.3),
            Criterion("largest error of the slabs over that of the half-space", low=1.0),
        ),
        figure="fig11",
    ),
    "span": Statement(
        "Sect. 5.2.2",
        "The height difference Δh between highest and lowest point is about 6 h_std for L/λᵣ = 2 and 8 "
        "for L/λᵣ = 8.",
        (
            Criterion(
                "number of the paper less the mean, in standard deviations of seeds", -2.0, 2.0
            ),
        ),
    ),
    "size_effect": Statement(
        "Fig. 12, Sect. 5.2.2",
        "Solutions deviate from the closed form of the Einstein foundation as u_g approaches Δh/2.",
        (Criterion("gap at which they differ by 5 %, over Δh/2", 0.5, 1.0),),
        figure="fig12",
    ),
    "einstein": Statement(
        "Fig. 12, Sects. 5.2.2 and 6",
        "Persson theory fails for the Einstein foundation at u_g/h_std ≳ 2.5.",
        (
            Criterion("error of the theoretical u_g at u_g/h_std = 2", high=0.05),
            Criterion("error of the theoretical u_g at u_g/h_std = 3.5", low=0.1),
        ),
        figure="fig12",
    ),
    "large_cell": Statement(
        "Sect. 5.2.2",
        "In larger cells the gap at small pressure stays within symbol size, n = 1/2 and 1.",
        (
            Criterion(
                "largest change of u_g against L = 2 λᵣ, in h_std (a symbol of Fig. 9a: 0.1)",
                high=0.1,
            ),
        ),
        figure="large_cell",
    ),
    "plate_area": Statement(
        "Sects. 2 and 5",
        "10 % contact of plates (n = 4) is computationally unfeasible.",
        (Criterion("relative error of the continuum a_r that is nearest to 0.1", low=0.5),),
        figure="light_area",
    ),
    "plate_limit": Statement(
        "Sects. 5 and 5.1",
        "n = 4: the singular stress at the contact line makes a_r difficult to define.",
        (
            Criterion(
                "change of a_r at a doubling of the grid over the change before (below 1 if there is "
                "a limit), p* ≥ 0.1",
                low=1.0,
            ),
        ),
        figure="light_area",
    ),
    "weight": Statement(
        "Eq. (30), Sect. 4.1",
        "The waves q of the surface carry the weight W = [γ + (1 − γ) a_r²] a_r of their energy of full "
        "contact.",
        (
            Criterion("measured W over Eq. (30), longest octave of waves", 0.67, 1.5),
            Criterion("measured W over Eq. (30), shortest octave of waves", 0.67, 1.5),
        ),
        figure="weights",
    ),
    "exact_order": Statement(
        "Sect. 6",
        "Persson theory is exact to second order in the inverse range of a soft repulsion.",
    ),
    "sampling": Statement(
        "Sects. 6 and 7",
        "The larger n, the smaller Δσ over the true contact (at equal a_r), which is the origin of γ.",
        (
            Criterion(
                "rms of K h shifted by a quarter wave (Eq. 22), n = 2 over n = 1/2", high=0.95
            ),
            Criterion("standard deviation of K h, n = 2 over n = 1/2", high=0.95),
        ),
    ),
    "percentile": Statement(
        "Sect. 7",
        "With Δσ over the highest 100 a_r % of the surface the area at the smallest pressures is right "
        "within O(10 %), n ≤ 1.",
        (Criterion("predicted over computed a_r at p* = 0.01", 0.85, 1.15),),
    ),
}
