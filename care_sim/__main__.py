"""`python -m care_sim`, the same as `care-sim`."""

from care_sim.cli import main

if __name__ == "__main__":
    main()
