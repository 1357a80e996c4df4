"""The explorer: one HTML page, published from stored studies, that runs the paper's step in the browser."""
