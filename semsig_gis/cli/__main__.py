"""Run the command by ``python -m semsig_gis.cli``."""

from semsig_gis.cli import main

if __name__ == "__main__":
    main()
