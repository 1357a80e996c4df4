"""Datasets in, figures out."""
