"""An attack on the promises beside proposed gains: python -m benchmarks.tuning.adversary."""
