"""Makes a place of a map, without a robot."""

import sys

from floor_plans.imports.command import main

if __name__ == '__main__':
    sys.exit(main())
