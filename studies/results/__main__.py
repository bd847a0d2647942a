"""`python -m studies.results`."""

import sys

from studies.results.command import main

if __name__ == "__main__":
    sys.argv[0] = "python -m studies.results"  # what --help and provenance.json say
    main()
