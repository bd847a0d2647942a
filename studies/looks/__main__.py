"""`python -m studies.looks`."""

import sys

from studies.looks.command import main

if __name__ == "__main__":
    sys.argv[0] = "python -m studies.looks"  # what --help and provenance.json say
    main()
