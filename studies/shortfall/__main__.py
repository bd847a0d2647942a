"""`python -m studies.shortfall`."""

import sys

from studies.shortfall.command import main

if __name__ == "__main__":
    sys.argv[0] = "python -m studies.shortfall"  # what --help and provenance.json say
    main()
