"""`python -m studies.failures`."""

import sys

from studies.failures.command import main

if __name__ == "__main__":
    sys.argv[0] = "python -m studies.failures"  # what --help and provenance.json say
    main()
