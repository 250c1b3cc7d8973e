"""The physics: wavenumbers, stiffness, surfaces, the contact problem, theory."""
