"""`python -m studies.rare_events`."""

import sys

from studies.rare_events.command import main

if __name__ == "__main__":
    sys.argv[0] = "python -m studies.rare_events"  # what --help and provenance.json say
    main()
