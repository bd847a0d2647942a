"""`python -m studies.realism`."""

import sys

from studies.realism.command import main

if __name__ == "__main__":
    sys.argv[0] = "python -m studies.realism"  # what --help and provenance.json say
    main()
