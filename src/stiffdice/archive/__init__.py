"""Archives: a study with all that made it in one file; verified, rebuilt and compared."""
