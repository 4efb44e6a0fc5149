"""The command line: one module a command.

May use: every room. Nothing imports it.
"""

from .app import main as main
