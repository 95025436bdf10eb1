"""Entry point of `python -m pcsr.cli`, which is the same as `pcsr`."""

from pcsr.cli import main

main()
