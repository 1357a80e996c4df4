"""Runs: launch, monitoring, criteria, outcome; other engines behind the same interface."""
