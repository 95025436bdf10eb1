"""`python -m pcsr.cli` does what `pcsr` does."""

from pcsr.cli import main

main()
