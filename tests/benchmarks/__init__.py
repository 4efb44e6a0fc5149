"""The benchmarks: their programs and pages."""
