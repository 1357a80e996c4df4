"""Figures of the contacts in models that other people wrote."""
