"""Archives: a study with all that made it in one file, checked and made again by whoever receives it."""
