"""Captions of the figures, in the order of the page."""

CAPTIONS = {
    "fig01": "Fig. 1: displacement over one period of a ridge (symbols) and of a line force (lines).",
    "fig02": "Fig. 2: stress over the distance from the axis, both in units of the values in the contact; lines: "
    "exact. n = 4: inside, σ = σ(0) = p; the line force at the edge lies beyond the axis.",
    "fig03": "Fig. 3: displacement over the distance from the axis, beside that of a point force in the same cell.",
    "fig03b": "The gap outside a parabolic contact; lines: exact, in an infinite plane.",
    "kappa": "Coefficient κ_n of the Hertz contact: solved contacts, closed form, and Persson theory.",
    "fig04": "Fig. 4: displacement along the diagonal at a_r = 0.1 in the continuum.",
    "fig05": "Fig. 5: stress at the highest point of the diagonal, 10 % contact on the grid; n = 3 halved.",
    "fig06a": "Fig. 6a: contact area in the continuum; arrows: upper limits, "
    "where twice the error exceeds half of the value.",
    "fig06b": "Fig. 6b: contact area in the continuum over that of Persson theory; arrows as in Fig. 6a.",
    "light_area": "n = 3 and 4, λᵣ/λₛ = 5: contact area in the continuum (symbols) and on the "
    "finest grid (dashed).",
    "fig07": "Fig. 7: distribution of the stress at a_r ≈ 0.1 in the continuum, mean over the seeds. Lines: finest grid; "
    "symbols: extrapolated, where the grids resolve it.",
    "fig08": "Fig. 8: stress deviation. n ≤ 2: continuum values; n = 3 has none, its "
    "values are those of the grid.",
    "light_deviation": "n = 3, λᵣ/λₛ = 5: stress deviation from grid to grid.",
    "fig09a": "Fig. 9a: mean gap.",
    "fig09b": "Fig. 9b: mean gap at large pressures.",
    "small_pressure": "Mean gap at small pressures on the grid.",
    "fig10a": "Fig. 10a: mean gap for H = 0.3.",
    "fig10b": "Fig. 10b: the same at large pressures.",
    "cut_off": "Mean gap for a cut-off spectrum.",
    "fig11": "Fig. 11: mean gap of slabs.",
    "fig12": "Fig. 12: mean gap of the Einstein foundation in two cells.",
    "large_cell": "Mean gap in cells of several sizes. n = 1/2: filled symbols, "
    "shifted to the right by 30 %; n = 1: open symbols.",
    "fig13": "Fig. 13: distribution of the stress at n = 3 from grid to grid.",
    "weights": "Weight of the elastic energy by wavenumber at p* = 0.1 (symbols) and Eq. 30 (lines).",
    "plate_map": "Contact (red) and gap on a quarter of the default surface at p* = 0.1.",
}
