"""Files in and out: YAML, and netCDF-4 on HDF5."""

# Of the HDF5 files; the part before the dot changes when an older reader could not understand them.
FORMAT_VERSION = "1.3"
