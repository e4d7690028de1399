"""`python -m skincli`."""

from skincli.cli import main

main()
