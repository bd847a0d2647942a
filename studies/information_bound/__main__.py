"""`python -m studies.information_bound`."""

import sys

from studies.information_bound.command import main

if __name__ == "__main__":
    sys.argv[0] = "python -m studies.information_bound"  # what --help and provenance.json say
    main()
