"""What ticks and loops cost, beside C++ and other libraries: python -m benchmarks.speed."""
