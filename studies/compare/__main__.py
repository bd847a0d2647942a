"""`python -m studies.compare`."""

import sys

from studies.compare.command import main

if __name__ == "__main__":
    sys.argv[0] = "python -m studies.compare"  # what --help and provenance.json say
    main()
