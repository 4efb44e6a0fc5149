"""The parts of benchmarks/hardware.py."""
