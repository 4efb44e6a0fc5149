"""The law at the tool against what a user has today."""
