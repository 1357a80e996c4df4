"""The commands about files of results: say what is in one, draw it, compare two."""
