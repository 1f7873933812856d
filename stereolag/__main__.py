"""The command ``stereolag``, run as ``python -m stereolag``."""

import sys

from stereolag.commands import main

if __name__ == "__main__":
    sys.exit(main())
