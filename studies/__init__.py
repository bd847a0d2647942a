"""Experiments over policies: each a command, `python -m studies.NAME`, in a folder or file of its name.

`statistics` and `campaign` serve them all, `compare` is the study that others build on, `testing` pins
ratios in pytest, and `launcher` runs every command of the packages. Everything may be imported here; nothing
imports this.
"""

import hda  # noqa: F401 - says so where another distribution's `guidance` stands in front of ours
