"""`python -m studies.rigid_plans`."""

import sys

from studies.rigid_plans.command import main

if __name__ == "__main__":
    sys.argv[0] = "python -m studies.rigid_plans"  # what --help and provenance.json say
    main()
