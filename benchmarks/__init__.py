"""The benchmarks, in rooms like those of src/rbimpedance; README.md lists them."""
