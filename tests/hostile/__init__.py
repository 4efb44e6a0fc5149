"""Malformed and hostile robot descriptions, each with the outcome that is right."""
