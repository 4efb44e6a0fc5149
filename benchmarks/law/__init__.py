"""Benchmarks of the room src/rbimpedance/law."""
