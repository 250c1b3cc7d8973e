"""Fourier coefficients of the fields of a grid, one array each."""


def forward(grid, field):
    """Coefficients of a field."""
    return grid.forward_into_work(field) / grid.size


def backward(grid, modes):
    """The field of these coefficients."""
    grid.work[...] = modes
    return grid.field_of_work()
