"""Datasets in, Markdown tables out."""
