"""Whether two studies hold the same bits."""

import h5py
import numpy as np

TIMES = ("seconds",)
OF_THE_RUN = ("date", "machine", "attributes_sha256")


def data(path):
    """All datasets of a study but the wall times, as bytes, and the texts of all attributes."""
    contents = {}
    with h5py.File(path, "r", locking=False) as file:

        def note(name, item):
            if isinstance(item, h5py.Dataset) and name not in TIMES:
                contents[name] = np.asarray(item[()]).tobytes()
            texts = ((key, value) for key, value in item.attrs.items() if isinstance(value, str))
            contents.update({f"{name} {key}": text for key, text in texts})

        note("", file)
        file.visititems(note)
    return {name: value for name, value in contents.items() if name.strip() not in OF_THE_RUN}


def assert_same_bits(path, other):
    a, b = data(path), data(other)
    assert a.keys() == b.keys()
    assert [name for name in a if a[name] != b[name]] == []
