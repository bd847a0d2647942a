"""`python -m studies.robustness`."""

import sys

from studies.robustness.command import main

if __name__ == "__main__":
    sys.argv[0] = "python -m studies.robustness"  # what --help and provenance.json say
    main()
