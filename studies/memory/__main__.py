"""`python -m studies.memory`."""

import sys

from studies.memory.command import main

if __name__ == "__main__":
    sys.argv[0] = "python -m studies.memory"  # what --help and provenance.json say
    main()
