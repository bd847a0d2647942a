"""`python -m studies.verify`."""

import sys

from studies.verify.command import main

if __name__ == "__main__":
    sys.argv[0] = "python -m studies.verify"  # what --help says
    main()
