"""Benchmarks of the room src/rbimpedance/study."""
