"""`python -m studies.stability`."""

import sys

from studies.stability.command import main

if __name__ == "__main__":
    sys.argv[0] = "python -m studies.stability"  # what --help and provenance.json say
    main()
