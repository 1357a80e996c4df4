"""`python -m stiffdice` is the command `stiffdice`."""

from stiffdice.cli.main import main

if __name__ == "__main__":
    raise SystemExit(main())
