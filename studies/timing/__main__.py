"""`python -m studies.timing`."""

import sys

from studies.timing.command import main

if __name__ == "__main__":
    sys.argv[0] = "python -m studies.timing"  # what --help and provenance.json say
    main()
