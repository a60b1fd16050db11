"""`python -m insonify` is the command `insonify`."""

import sys

from ._program import main

sys.exit(main())
