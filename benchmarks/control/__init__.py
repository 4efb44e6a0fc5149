"""Benchmarks of the room src/rbimpedance/control."""
