"""Benchmarks of the room src/rbimpedance/robot."""
