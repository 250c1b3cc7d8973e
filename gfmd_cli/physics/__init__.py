"""The physics: stiffness, surfaces, the contact problem, observables, theory, error estimates."""
