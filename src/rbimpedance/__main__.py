"""`python -m rbimpedance` is the command line."""

from .cli import main

main()
