"""Benchmarks of the room src/rbimpedance/pictures."""
