"""Checks of arrays and numbers, files, and suggestions for misspelt names.

May use: nothing of the package but `exceptions`.
"""
