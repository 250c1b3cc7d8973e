"""Files on disk: atomic writes, locks, checksums, HDF5. Nothing of physics."""
