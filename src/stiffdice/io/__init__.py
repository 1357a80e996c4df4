"""Files in and out: netCDF-4 on HDF5, checked before they are read; no physics."""
