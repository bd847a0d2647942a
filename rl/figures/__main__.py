"""`python -m rl.figures`."""

import sys

from rl.figures.command import main

if __name__ == "__main__":
    sys.argv[0] = "python -m rl.figures"  # what --help says
    main()
