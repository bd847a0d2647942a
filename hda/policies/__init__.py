"""Policies that need no learning: compositions of a site selection and a guidance law."""
