"""``python -m collide`` is the command ``collide``."""

import sys

from collide.cli.main import main

if __name__ == "__main__":
    sys.exit(main())
