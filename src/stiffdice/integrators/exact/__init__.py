"""The scheme that steps linear contact by its exact solution."""
