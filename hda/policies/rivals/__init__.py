"""Policies of other groups, rebuilt from what their papers say; docstrings list sources and deviations.

They meet the same looks and vehicle as the rest, and fly when asked for by name, as `rivals` or with `all`.
They read the beliefs, the price's estimates and the laws beside them; only the catalogue imports them.
"""
