"""Benchmarks of the room src/rbimpedance/tuning."""
