"""Controllers: the law as one tick on an arm, baselines, guards around controllers, and the control loop.

May use: `law`, `robot`, `interaction`, `trajectories` and what they use.
"""
