"""`python -m studies.closed_loop`."""

import sys

from studies.closed_loop.command import main

if __name__ == "__main__":
    sys.argv[0] = "python -m studies.closed_loop"  # what --help and provenance.json say
    main()
