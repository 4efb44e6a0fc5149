"""The parts of the script: python -m benchmarks.control.hardware."""
