"""What the control loop costs: `rbimpedance bench` and the figures of docs/benchmarks.md."""
