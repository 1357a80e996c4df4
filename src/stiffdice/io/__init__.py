"""Files in and out: YAML, netCDF-4 on HDF5, provenance."""
