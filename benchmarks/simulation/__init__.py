"""Benchmarks of the room src/rbimpedance/simulation."""
