"""`python -m rl.dataset`."""

from rl.dataset.command import main

if __name__ == "__main__":
    main()
