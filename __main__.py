"""``python -m fieldgym`` is the ``fieldgym`` command."""

from .scripts.cli import main

if __name__ == "__main__":
    main()
