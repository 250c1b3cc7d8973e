"""Changes to HDF5 files that leave them readable: attributes, datasets, groups and links."""

import h5py
import numpy as np
from hypothesis import strategies as st

VALUES = (
    np.float64(np.nan), np.int64(-1), np.uint64(2**63), np.bytes_(b"text"), np.zeros(0),
    np.zeros((3, 0)), np.zeros((2, 2)), np.zeros(16, "f4"), np.zeros((1, 1, 1, 1)), np.arange(7),
    np.array([b"a_r", b"nothing"]), np.array([b"\xff\xfe"]), np.zeros(2, "c16"), np.True_,
    np.zeros(3, [("a", "f8")]), h5py.Empty("f8"), "text of any length",
)  # fmt: skip
HOW = ("remove", "value", "rename", "group", "soft", "external", "attribute")
WHERE = ("/", "/nowhere", "/scenes", "/scenes/0/q", "../s.toml")


def objects(file):
    """The paths of all groups and datasets."""
    paths = []
    file.visit(paths.append)
    return paths


def change(file, draw):
    """Change one attribute, dataset, group or link of a file."""
    path, how = draw(st.sampled_from(objects(file))), draw(st.sampled_from(HOW))
    if how == "attribute":
        place = draw(st.sampled_from([file, file[path]]))
        place.attrs[draw(st.sampled_from([*place.attrs, "more"]))] = draw(st.sampled_from(VALUES))
        return
    if how == "rename":
        file.move(path, draw(st.sampled_from(["scenes/1", "more", "fields/99"])))
        return
    del file[path]
    if how == "value":
        file[path] = draw(st.sampled_from(VALUES))
    elif how == "group":
        file.create_group(path)
    elif how == "soft":
        file[path] = h5py.SoftLink(draw(st.sampled_from(WHERE)))
    elif how == "external":
        file[path] = h5py.ExternalLink("../s.toml", "/")
