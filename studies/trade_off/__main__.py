"""`python -m studies.trade_off`."""

import sys

from studies.trade_off.command import main

if __name__ == "__main__":
    sys.argv[0] = "python -m studies.trade_off"  # what --help and provenance.json say
    main()
