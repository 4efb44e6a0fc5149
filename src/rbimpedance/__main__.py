"""`python -m rbimpedance` is the command line."""

from .cli.app import main

main()
