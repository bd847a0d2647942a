"""Experiments over policies: each a command, `python -m studies.NAME`, in a folder or file of its name.

`statistics` and `campaign` serve them all, `compare` is the study that others build on, and `testing` pins
ratios in pytest. Everything may be imported here; nothing imports this.
"""

import rl  # noqa: F401 - puts the learning agents into the registry
