"""Truth from outside: closed forms that never import the package under test."""
