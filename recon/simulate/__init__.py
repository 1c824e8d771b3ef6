"""Sequences with known truth from a plan."""
