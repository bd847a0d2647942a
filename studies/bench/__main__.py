"""`python -m studies.bench`."""

import sys

from studies.bench.command import main

if __name__ == "__main__":
    sys.argv[0] = "python -m studies.bench"  # what --help and provenance.json say
    main()
