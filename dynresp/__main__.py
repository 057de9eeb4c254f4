"""`python -m dynresp` is `dynresp`."""

from dynresp.cli import main

main()
